//! The page: tables, charts and what they say, from the journal alone.

use std::fmt::Write as _;
use std::path::Path;

use super::chart::{Labels, Line, log_lines, stacked_bars};
use super::figures::{NormalError, Radii};
use super::journal::Journal;
use super::measure::{Accuracy, FirstRadius, K, KiddoTimes, Method, Outcome, Renderers, Timing};
use super::scenes::PaperScene;
use super::{Task, picture_name};
use crate::exit::Failure;
use crate::output::write_file;

/// The chart of Figure 11.
const CONVERGENCE: &str = "figure-11.svg";

/// What a page is made from.
#[derive(Debug)]
pub(super) struct Report<'a> {
    pub(super) journal: &'a Journal,
    pub(super) renderers: &'a Renderers,
    pub(super) scenes: &'a [PaperScene],
    pub(super) ks: &'a [u32],
    /// Key of Figure 7.
    pub(super) scales: &'a str,
}

impl Report<'_> {
    fn timing(&self, scene: &PaperScene, task: Task) -> Option<Outcome<Timing>> {
        self.journal.get(&task.key(scene, self.renderers))
    }

    /// Milliseconds of search, and per reconstructed point, or why there are none.
    fn search(&self, scene: &PaperScene, method: Method, culled: bool) -> String {
        match self.timing(scene, Task::Table(method, culled)) {
            Some(Outcome::Measured(timing)) => {
                let build =
                    if timing.build > 0.0 { format!(", {:.1} of them build-up", timing.build) } else { String::new() };
                format!(
                    "{:.1} ({:.2} µs{build})",
                    timing.search,
                    1e3 * timing.search / timing.reconstructed.max(1) as f64
                )
            }
            Some(Outcome::Refused(_)) => "refused".into(),
            None => "–".into(),
        }
    }

    /// The whole page, in Markdown.
    pub(super) fn page(&self) -> String {
        let mut page = String::from(
            "# The paper's evaluation, repeated\n\n\
             Written by `autosplats bench paper`; `autosplats bench paper --help` says how to repeat it. The paper is Preiner, \
             Jeschke and Wimmer, *Auto Splats*, 2012 ([ARCHITECTURE.md](../ARCHITECTURE.md)); its figures are from a GeForce \
             GTX 580 with an Intel i7-930. Measured here on:\n\n",
        );
        for device in self.renderers.describe() {
            _ = writeln!(page, "- {device}");
        }
        page += "\nScenes:\n\n| scene | the paper's points | visible there | points here | picture | what it is |\n|---|--:|--:|--:|---|---|\n";
        for scene in self.scenes {
            let PaperScene { name, paper, points, size: [width, height], .. } = scene;
            _ = writeln!(
                page,
                "| {name} | {} | {} | {points} | {width}x{height} | {} |",
                paper.points,
                paper.pixels,
                scene.origin()
            );
        }
        page += "\n";
        for scene in self.scenes {
            _ = writeln!(page, "![{}](results/{})", scene.name, picture_name(scene));
        }
        self.table_1(&mut page);
        self.ratios(&mut page);
        self.culling(&mut page);
        self.accuracy(&mut page);
        self.figure_6(&mut page);
        self.figure_7(&mut page);
        self.figure_9(&mut page);
        self.figure_10(&mut page);
        self.figure_11(&mut page);
        self.refusals(&mut page);
        page
    }

    fn table_1(&self, page: &mut String) {
        _ = write!(
            page,
            "\n## Table 1: finding the {K} nearest neighbours\n\nMilliseconds, and in brackets microseconds for each point \
             reconstructed; \\* with grid culling. A kd-tree holds all points and is built anew for each frame.\n\n\
             | scene | visible | reconstructed | paper: kd-tree | paper: Auto Splats |"
        );
        for method in Method::ALL {
            _ = write!(page, " {} |", method.name());
        }
        *page += " kiddo, CPU: visible points | all |\n|---|--:|--:|--:|--:|";
        *page += &"--:|".repeat(Method::ALL.len() + 2);
        *page += "\n";
        for scene in self.scenes {
            let kiddo: Option<Outcome<KiddoTimes>> = self.journal.get(&Task::Kiddo.key(scene, self.renderers));
            for culled in [false, true] {
                let Some(Outcome::Measured(timing)) = self.timing(scene, Task::Table(Method::GridCpu, culled)) else {
                    continue;
                };
                let or_none = |value: Option<f64>| value.map_or_else(|| "–".to_owned(), |ms| format!("{ms}"));
                let paper = if culled { scene.paper.culled } else { Some(scene.paper.splat_communication) };
                let star = if culled { "\\*" } else { "" };
                _ = write!(
                    page,
                    "| {}{star} | {} | {} | {} | {} |",
                    scene.name,
                    timing.visible,
                    timing.reconstructed,
                    or_none(scene.paper.kd_tree),
                    or_none(paper)
                );
                for method in Method::ALL {
                    _ = write!(page, " {} |", self.search(scene, method, culled));
                }
                match &kiddo {
                    Some(Outcome::Measured(KiddoTimes { visible_ms, all_ms })) if !culled => {
                        _ = writeln!(page, " {visible_ms:.0} | {all_ms:.0} |");
                    }
                    _ => *page += " | |\n",
                }
            }
        }
    }

    /// The paper's speedups: the kd-tree's time over that of another search, by point and overall.
    fn ratios(&self, page: &mut String) {
        *page += "\n### Ratios on one device\n\n\
                  The kd-tree searches all points, the others the visible ones. By point is time per point searched for, \
                  overall is time. The paper, against its own kd-tree: bunny 1.47 by point and 1.56 overall, Imperia 1.37 and \
                  2.57, horses 1.00 and 1.44, with culling 1.64 and 2.38.\n\n\
                  | scene | kd-tree's first radius, accuracy | kd-tree over splat communication: by point | overall \
                  | kd-tree over screen grid: by point | overall | splat communication over screen grid |\n\
                  |---|---|--:|--:|--:|--:|--:|\n";
        for scene in self.scenes {
            for culled in [false, true] {
                let of = |method| self.timing(scene, Task::Table(method, culled)).and_then(Outcome::into_measured);
                let [grid, communication, tree] = [Method::GridGpu, Method::Communication, Method::KdTree].map(of);
                // All points were searched for, whatever was visible.
                let by_point = |tree: &Timing, other: &Timing| {
                    (tree.search / scene.points as f64) / (other.search / other.reconstructed.max(1) as f64)
                };
                let pair = |tree: &Option<Timing>, other: &Option<Timing>| match (tree, other) {
                    (Some(tree), Some(other)) => {
                        format!("{:.2} | {:.2}", by_point(tree, other), tree.search / other.search)
                    }
                    _ => "– | –".into(),
                };
                let radius: Option<Outcome<FirstRadius>> =
                    self.journal.get(&Task::FirstRadius.key(scene, self.renderers));
                let radius = match radius {
                    Some(Outcome::Measured(FirstRadius { radius, accuracy })) => {
                        format!("{radius:.4}, {}", percent(accuracy))
                    }
                    _ => "–".into(),
                };
                let last = match (&communication, &grid) {
                    (Some(communication), Some(grid)) => format!("{:.1}", communication.search / grid.search),
                    _ => "–".into(),
                };
                let star = if culled { "\\*" } else { "" };
                _ = writeln!(
                    page,
                    "| {}{star} | {radius} | {} | {} | {last} |",
                    scene.name,
                    pair(&tree, &communication),
                    pair(&tree, &grid)
                );
            }
        }
    }

    fn culling(&self, page: &mut String) {
        *page += "\n## Grid culling\n\n\
                  Search with culling as part of that without, and what it changes: pixels that differ by more than two steps \
                  of 255. The paper has 71 for 117 ms (0.61) with the horses, 123 for 264 (0.47) in the cathedral.\n\n\
                  | scene | paper |";
        for method in Method::ALL {
            _ = write!(page, " {} |", method.name());
        }
        *page += " pixels that differ |\n|---|--:|";
        *page += &"--:|".repeat(Method::ALL.len() + 1);
        *page += "\n";
        for scene in self.scenes {
            let paper = scene
                .paper
                .culled
                .map_or_else(|| "–".to_owned(), |culled| format!("{:.2}", culled / scene.paper.splat_communication));
            _ = write!(page, "| {} | {paper} |", scene.name);
            for method in Method::ALL {
                let of = |culled| self.timing(scene, Task::Table(method, culled));
                match (of(true), of(false)) {
                    (Some(Outcome::Measured(with)), Some(Outcome::Measured(without))) => {
                        _ = write!(page, " {:.2} |", with.search / without.search);
                    }
                    _ => *page += " – |",
                }
            }
            let differ: Option<f64> = self.journal.get(&Task::Culling.key(scene, self.renderers));
            _ = writeln!(page, " {} |", differ.map_or_else(|| "–".to_owned(), percent));
        }
    }

    fn accuracy(&self, page: &mut String) {
        _ = write!(
            page,
            "\n## Accuracy\n\n\
             Parts of the visible points whose neighbourhood is the exact one, by its k-radius to a part in ten thousand: among \
             visible points (what a search in the picture can find), and among all points of the cloud (the price of searching \
             in the picture). A search that meets its bound keeps what it is sure of, and is not exact. k = {K}; rules for \
             outliers and gaps off, no culling; one frame, the first.\n\n\
             | scene | method | exact on the screen | met the bound | exact in space | search, µs a point |\n\
             |---|---|--:|--:|--:|--:|\n"
        );
        for scene in self.scenes {
            for method in Method::ALL {
                let measured: Option<Outcome<Accuracy>> =
                    self.journal.get(&Task::Accuracy(method).key(scene, self.renderers));
                let Some(Accuracy { on_screen, in_space, bounded, us_per_point }) =
                    measured.and_then(Outcome::into_measured)
                else {
                    continue;
                };
                _ = writeln!(
                    page,
                    "| {} | {} | {} | {} | {} | {us_per_point:.2} |",
                    scene.name,
                    method.name(),
                    percent(on_screen),
                    percent(bounded),
                    percent(in_space)
                );
            }
        }
    }

    fn figure_6(&self, page: &mut String) {
        let Some(scene) = self.scenes.iter().find(|scene| scene.name == "bunny") else { return };
        let Some(NormalError { points, mean, median, rmse, within_5, within_10, psnr }) =
            self.journal.get(&Task::Normals.key(scene, self.renderers))
        else {
            return;
        };
        _ = write!(
            page,
            "\n## Figure 6: normals on the fly and beforehand\n\n\
             ![on the fly; beforehand](results/figure-6.png)\n\n\
             Left: normals found on the fly, among the visible points. Right: found beforehand among all points by the same \
             estimator, k = {K}. The paper shows the pictures and observes \"a similar visualization\", with \"minor artifacts \
             due to information loss at silhouettes\". Here, over {points} points: {mean:.2}° between the normals in the mean, \
             {median:.2}° in the median, {rmse:.2}° root mean square; {} below 5°, {} below 10°. The pictures are {psnr:.1} dB \
             apart (PSNR).\n",
            percent(within_5),
            percent(within_10),
        );
    }

    fn figure_7(&self, page: &mut String) {
        let Some(Radii { large, small }) = self.journal.get(self.scales) else { return };
        _ = write!(
            page,
            "\n## Figure 7: two scales\n\n\
             ![surface; k-radius; single splats; nearer](results/figure-7.png)\n\n\
             As many points on the small body as on the large one: the surface, the k-radius in colours, splats made smaller so \
             that single ones are seen, and those of the small one seven times as near. No parameter says how large anything \
             is: the k-radius is {large:.4} on the large body and {small:.4} on the small one in the median, {:.1} to one.\n",
            large / small
        );
    }

    fn figure_9(&self, page: &mut String) {
        let Some(scene) = self.scenes.iter().find(|scene| scene.name == "imperia") else { return };
        if !self.journal.has(&Task::Curvature.key(scene, self.renderers)) {
            return;
        }
        *page += "\n## Figure 9: curvature\n\n\
                  ![the statue; nearer; its curvature](results/figure-9.png)\n\n\
                  The statue, a closer look, and the surface variation there, found in the same frame as the normals.\n";
    }

    fn figure_10(&self, page: &mut String) {
        *page += "\n## Figure 10: time per stage\n\n\
                  With grid culling, for neighbourhoods of different sizes. In the paper the search is the main part \
                  throughout.\n\n";
        for scene in self.scenes {
            for method in Method::BY_STAGE {
                if self.bars(scene, method).is_empty() {
                    continue;
                }
                _ = writeln!(page, "![{}, {}](results/{})", scene.name, method.name(), chart_name(scene, method));
            }
        }
    }

    fn figure_11(&self, page: &mut String) {
        let lines = self.convergence();
        if lines.is_empty() {
            return;
        }
        _ = write!(
            page,
            "\n## Figure 11: convergence of splat communication\n\n\
             ![points without a radius](results/{CONVERGENCE})\n\n\
             Points without a k-radius before each iteration, k = {K}, no culling. The paper: 7 to 10 iterations to 99.9 %, \
             \"generally, 6–7 iterations already provide a good quality\". Converged here, in percent:\n\n| scene |"
        );
        let longest = lines.iter().map(|line| line.points.len()).max().unwrap_or(1);
        for iteration in 1..longest {
            _ = write!(page, " {iteration} |");
        }
        *page += "\n|---|";
        *page += &"--:|".repeat(longest - 1);
        *page += "\n";
        for line in &lines {
            _ = write!(page, "| {} |", line.name);
            for [_, left] in line.points.iter().skip(1) {
                _ = write!(page, " {:.2} |", 100.0 - left);
            }
            *page += &" |".repeat(longest - line.points.len());
            *page += "\n";
        }
    }

    /// For each scene the percentage of points left before each iteration, from the first on.
    fn convergence(&self) -> Vec<Line> {
        let line = |scene: &PaperScene| {
            let timing = self.timing(scene, Task::Table(Method::Communication, false))?.into_measured()?;
            let asked = f64::from(*timing.convergence.first()?);
            // Iterations after the last that was needed change nothing.
            let mut left = timing.convergence;
            while left.len() > 1 && left[left.len() - 1] == left[left.len() - 2] {
                left.pop();
            }
            let points = left.iter().zip(1u32..).map(|(&left, at)| [f64::from(at), 100.0 * f64::from(left) / asked]);
            Some(Line { name: scene.name.into(), points: points.collect() })
        };
        self.scenes.iter().filter_map(line).collect()
    }

    /// Why there are no figures where there are none.
    fn refusals(&self, page: &mut String) {
        let mut lines = Vec::new();
        for scene in self.scenes {
            for method in Method::ALL {
                if let Some(Outcome::Refused(why)) = self.timing(scene, Task::Table(method, false)) {
                    lines.push(format!("- {}, {}: {why}", scene.name, method.name()));
                }
            }
            let kiddo: Option<Outcome<KiddoTimes>> = self.journal.get(&Task::Kiddo.key(scene, self.renderers));
            if let Some(Outcome::Refused(why)) = kiddo {
                lines.push(format!("- {}, kiddo: {why}", scene.name));
            }
        }
        if !lines.is_empty() {
            *page += "\n## What was refused\n\n";
            *page += &lines.join("\n");
            *page += "\n";
        }
    }

    /// Milliseconds of each stage, for each k that was measured.
    fn bars(&self, scene: &PaperScene, method: Method) -> Vec<(String, Vec<f64>)> {
        let bar = |&k: &u32| {
            let Some(Outcome::Measured(timing)) = self.timing(scene, Task::Stages(method, k)) else { return None };
            let Timing { project, search, fit, splat, shade, .. } = timing;
            Some((k.to_string(), vec![project, search, fit, splat, shade]))
        };
        self.ks.iter().filter_map(bar).collect()
    }

    /// Writes the charts that the page shows.
    pub(super) fn write_charts(&self, folder: &Path) -> Result<(), Failure> {
        let labels =
            Labels { title: "splat communication", x: "iteration", y: "% of the points without a radius before it" };
        let lines = self.convergence();
        if !lines.is_empty() {
            let svg = log_lines(labels, &lines);
            write_file(&folder.join(CONVERGENCE), |writer| std::io::Write::write_all(writer, svg.as_bytes()))?;
        }
        for scene in self.scenes {
            for method in Method::BY_STAGE {
                let bars = self.bars(scene, method);
                if bars.is_empty() {
                    continue;
                }
                let title = format!("{}, {}", scene.name, method.name());
                let labels = Labels { title: &title, x: "k", y: "ms" };
                let svg = stacked_bars(labels, &["project", "search", "fit", "splat", "shade"], &bars);
                write_file(&folder.join(chart_name(scene, method)), |writer| {
                    std::io::Write::write_all(writer, svg.as_bytes())
                })?;
            }
        }
        Ok(())
    }
}

fn chart_name(scene: &PaperScene, method: Method) -> String {
    let method: String = method.name().to_lowercase().replace(", ", "-").replace(' ', "-");
    format!("figure-10-{}-{method}.svg", scene.name)
}

/// A part as a percentage with as many digits as tell it from all and nothing.
fn percent(part: f64) -> String {
    let percent = 100.0 * part;
    let rest = percent.min(100.0 - percent);
    if rest <= 0.0 || rest >= 1.0 { format!("{percent:.1} %") } else { format!("{percent:.3} %") }
}
