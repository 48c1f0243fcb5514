//! `autosplats topics`: lists the topics that robots publish over Zenoh.

use crate::args::TopicsArgs;
use crate::console::Console;
use crate::exit::Failure;

/// Lists the topics at an address, those with points first.
#[cfg(feature = "zenoh")]
pub(crate) fn run(args: &TopicsArgs, console: &Console) -> Result<(), Failure> {
    use autosplats_sources::remote::topics;

    use crate::progress::Bar;

    let TopicsArgs { address, wait, json, run: _ } = args;
    let bar = Bar::spinner("listening", console);
    let found = topics(address, *wait)?;
    drop(bar);
    for topic in &found {
        let (points, publishers) = (topic.has_points(), topic.publishers);
        if *json {
            let line = serde_json::json!({
                "name": topic.name, "type": topic.kind, "domain": topic.domain, "publishers": publishers, "points": points,
            });
            console.print_line(line)?;
        } else {
            let domain = topic.domain.map_or_else(String::new, |domain| format!("  domain {domain}"));
            console.print_line(format_args!("{:40} {}  {publishers} publishing{domain}", topic.name, topic.kind))?;
        }
    }
    if !found.iter().any(|topic| topic.has_points()) {
        console.note("no topic has points (sensor_msgs/PointCloud2)");
    }
    Ok(())
}

/// Fails: this build has no Zenoh.
#[cfg(not(feature = "zenoh"))]
pub(crate) fn run(args: &TopicsArgs, _console: &Console) -> Result<(), Failure> {
    let TopicsArgs { address, .. } = args;
    Err(Failure::usage(format!("{address}: this build has no Zenoh; build it with the feature 'zenoh'")))
}
