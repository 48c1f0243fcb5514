//! `autosplats topics`: lists the topics that robots publish over Zenoh.

use crate::args::TopicsArgs;
use crate::exit::Failure;

/// Lists the topics at an address, those with points first.
#[cfg(feature = "zenoh")]
pub(crate) fn run(args: &TopicsArgs) -> Result<(), Failure> {
    use autosplats_sources::remote::topics;

    use crate::exit::Exit;
    use crate::output::print_line;
    use crate::progress::Bar;

    let TopicsArgs { address, wait, json, run } = args;
    let bar = Bar::spinner("listening", run.quiet);
    let found = topics(address, *wait).map_err(|error| Failure::new(Exit::Input, error))?;
    drop(bar);
    for topic in &found {
        let (points, publishers) = (topic.has_points(), topic.publishers);
        if *json {
            let line = serde_json::json!({
                "name": topic.name, "type": topic.kind, "domain": topic.domain, "publishers": publishers, "points": points,
            });
            print_line(&line.to_string())?;
        } else {
            let domain = topic.domain.map_or_else(String::new, |domain| format!("  domain {domain}"));
            print_line(&format!("{:40} {}  {publishers} publishing{domain}", topic.name, topic.kind))?;
        }
    }
    if !run.quiet && !found.iter().any(|topic| topic.has_points()) {
        eprintln!("note: no topic has points (sensor_msgs/PointCloud2)");
    }
    Ok(())
}

/// Fails: this build has no Zenoh.
#[cfg(not(feature = "zenoh"))]
pub(crate) fn run(args: &TopicsArgs) -> Result<(), Failure> {
    let TopicsArgs { address, .. } = args;
    Err(Failure::usage(format!("{address}: this build has no Zenoh; build it with the feature 'zenoh'")))
}
