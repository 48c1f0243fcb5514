//! The page: tables, charts and text, from the journal alone.

use std::fmt::Write as _;
use std::path::Path;

use super::chart::{Labels, Line, log_lines, stacked_bars};
use super::figures::{NormalError, Radii};
use super::journal::Journal;
use super::measure::{Accuracy, FirstRadius, K, KiddoTimes, Method, Outcome, Renderers, Timing, iterations};
use super::numbers::{percent, speedups};
use super::scenes::PaperScene;
use super::{FIGURE_6, FIGURE_7, FIGURE_9, FRAMES, Task, picture_name, tasks};
use crate::exit::Failure;
use crate::output::write_file;

/// File name of the chart of Figure 11.
const CONVERGENCE: &str = "figure-11.svg";

/// Input of the page.
#[derive(Debug)]
pub(super) struct Report<'a> {
    pub(super) journal: &'a Journal,
    pub(super) renderers: &'a Renderers,
    pub(super) scenes: &'a [PaperScene],
    pub(super) ks: &'a [u32],
    /// Key of Figure 7 in the journal.
    pub(super) scales: &'a str,
    /// Name of the folder with pictures and charts, beside the page.
    pub(super) folder: &'a str,
    /// Whether scenes are small.
    pub(super) quick: bool,
}

impl Report<'_> {
    fn timing(&self, scene: &PaperScene, task: Task) -> Option<Outcome<Timing>> {
        self.journal.get(&task.key(scene, self.renderers))
    }

    /// A cell of Table 1: milliseconds of the search, and microseconds per point searched for.
    fn search(&self, scene: &PaperScene, method: Method, culled: bool) -> String {
        match self.timing(scene, Task::Table(method, culled)) {
            Some(Ok(timing)) => {
                let searched = if method == Method::KdTree { timing.points } else { timing.reconstructed };
                let per_point = 1e3 * timing.search / searched.max(1) as f64;
                let build = if timing.build > 0.0 { format!(", build {:.1}", timing.build) } else { String::new() };
                let once = if timing.frames == 1 { ", once" } else { "" };
                format!("{:.1} ({per_point:.2} µs{build}{once})", timing.search)
            }
            Some(Err(_)) => "refused".into(),
            None => "–".into(),
        }
    }

    /// The whole page, in Markdown.
    pub(super) fn page(&self) -> String {
        let folder = self.folder;
        let mut page = String::from("# The paper's evaluation, repeated\n\n");
        if self.quick {
            page += "**A quick run: scenes and pictures are small, so the numbers mean little.**\n\n";
        }
        page.push_str(
            "This page is written by `autosplats bench paper`; `autosplats bench paper --help` says how to repeat it. \
             The paper is Preiner, Jeschke and Wimmer, *Auto Splats*, 2012. It measured on a GeForce GTX 580 and an \
             Intel i7-930. This page was measured on:\n\n",
        );
        for device in self.renderers.describe() {
            _ = writeln!(page, "- {device}");
        }
        page += "\nScenes:\n\n| scene | points, paper | visible, paper | points here | picture | contents here |\n|---|--:|--:|--:|---|---|\n";
        for scene in self.scenes {
            let PaperScene { name, paper, size: [width, height], .. } = scene;
            let points = match self.timing(scene, Task::Table(Method::GridCpu, false)) {
                Some(Ok(timing)) => timing.points.to_string(),
                _ => "–".into(),
            };
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
            _ = writeln!(page, "![{}]({folder}/{})", scene.name, picture_name(scene));
        }
        self.table_1(&mut page);
        self.why_times_differ(&mut page);
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
            "\n## Table 1: finding the {K} nearest neighbours\n\nTimes are in milliseconds. Each is the median of up \
             to {FRAMES} frames after a warm-up frame. A frame of more than three seconds is measured once, without \
             warm-up. Rows with \\* use grid culling. Brackets give the microseconds for each point searched for: the \
             reconstructed points, or all points for a kd-tree. A kd-tree holds all points and is built again for each \
             frame; its time includes the build.\n\n\
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
                let Some(Ok(timing)) = self.timing(scene, Task::Table(Method::GridCpu, culled)) else {
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
                    Some(Ok(KiddoTimes { visible_ms, all_ms })) if !culled => {
                        _ = writeln!(page, " {visible_ms:.0} | {all_ms:.0} |");
                    }
                    _ => *page += " | |\n",
                }
            }
        }
    }

    /// Explains why the times differ from the paper's.
    fn why_times_differ(&self, page: &mut String) {
        *page += "\nWhy the times differ: the paper measured on a graphics card of 2012, which rasterises in hardware.";
        if self.renderers.is_software() {
            *page += " The GPU here is software on the processor. It rasterises and blends with a few cores, and the \
                      program waits for each pass. Its times say nothing about a graphics card. Ratios between its \
                      columns may say something, except those of splat communication, which is the method that \
                      rasterises.";
        }
        *page += " The screen grid works in another way than both rivals. Splat communication draws each neighbourhood \
                  in about ten iterations; the screen grid reads it. A kd-tree searches for all points, because it \
                  does not know which are visible; the screen grid searches for visible points only.\n";
    }

    /// Speedups as in the paper: the kd-tree's time over that of another search, per point and overall.
    fn ratios(&self, page: &mut String) {
        *page += "\n### Ratios on one device\n\n\
                  The ratios compare search times. *Overall* divides time by time. *By point*, as in the paper, first \
                  divides the kd-tree's time by all points and the other time by the visible points. The paper's \
                  ratios of its kd-tree over splat communication, by point and overall, are 1.47 and 1.56 (bunny), \
                  1.37 and 2.57 (Imperia), 1.00 and 1.44 (horses), 1.64 and 2.38 (horses with culling). The kd-tree \
                  here uses the fastest of several first radii that find 99.9 % of the k-radii.\n\n\
                  | scene | kd-tree's first radius, accuracy | kd-tree over splat communication: by point | overall \
                  | kd-tree over screen grid: by point | overall | splat communication over screen grid |\n\
                  |---|---|--:|--:|--:|--:|--:|\n";
        let mut missed = Vec::new();
        for scene in self.scenes {
            for culled in [false, true] {
                let of = |method| self.timing(scene, Task::Table(method, culled)).and_then(Result::ok);
                let [grid, communication, tree] = [Method::GridGpu, Method::Communication, Method::KdTree].map(of);
                let pair = |tree: &Option<Timing>, other: &Option<Timing>| match (tree, other) {
                    (Some(tree), Some(other)) => {
                        Some(speedups([tree.search, other.search], [tree.points, other.visible]))
                    }
                    _ => None,
                };
                let shown = |speedups: Option<[f64; 2]>| {
                    speedups.map_or_else(|| "– | –".into(), |[point, overall]| format!("{point:.2} | {overall:.2}"))
                };
                let star = if culled { "\\*" } else { "" };
                let over_grid = pair(&tree, &grid);
                if let Some(ratios) = over_grid
                    && ratios.iter().any(|ratio| *ratio <= 1.0)
                {
                    missed.push(format!("{}{star}: the kd-tree is not slower than the screen grid", scene.name));
                }
                let last = match (&communication, &grid) {
                    (Some(communication), Some(grid)) => Some(communication.search / grid.search),
                    _ => None,
                };
                if last.is_some_and(|ratio| ratio < 10.0) {
                    missed.push(format!(
                        "{}{star}: the screen grid is not ten times as fast as the paper's search",
                        scene.name
                    ));
                }
                let radius: Option<Outcome<FirstRadius>> =
                    self.journal.get(&Task::FirstRadius.key(scene, self.renderers));
                let radius = match radius {
                    Some(Ok(FirstRadius { radius, accuracy })) => {
                        format!("{radius:.4}, {}", percent(accuracy))
                    }
                    _ => "–".into(),
                };
                _ = writeln!(
                    page,
                    "| {}{star} | {radius} | {} | {} | {} |",
                    scene.name,
                    shown(pair(&tree, &communication)),
                    shown(over_grid),
                    last.map_or_else(|| "–".into(), |ratio| format!("{ratio:.1}"))
                );
            }
        }
        if !missed.is_empty() {
            _ = writeln!(page, "\nExpectations that this run misses: {}.", missed.join("; "));
        }
    }

    fn culling(&self, page: &mut String) {
        *page += "\n## Grid culling\n\n\
                  The table gives the search time with culling divided by the time without. The last column is the \
                  share of pixels that culling changes by more than 2 of 255. In the paper, culling reduces 117 ms to \
                  71 ms (0.61) for the horses and 264 ms to 123 ms (0.47) for the cathedral.\n\n\
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
                    (Some(Ok(with)), Some(Ok(without))) => {
                        _ = write!(page, " {:.2} |", with.search / without.search);
                    }
                    _ => *page += " – |",
                }
            }
            let differ: Option<f64> = self.journal.get(&Task::Culling.key(scene, self.renderers));
            _ = writeln!(page, " {} |", differ.map_or_else(|| "–".to_owned(), percent));
        }
        *page += "\nWhy the ratios differ: culling saves the work for visible points that lie behind a surface. Table \
                  1 shows their share: the visible points that are not reconstructed. Some points are hidden only by \
                  splats that stick out of a silhouette. They are put back after the first depth map, because holes \
                  would open there. Splat communication iterates again for these points. The paper does not say what \
                  culling changes in its pictures.\n";
    }

    fn accuracy(&self, page: &mut String) {
        _ = write!(
            page,
            "\n## Accuracy\n\n\
             The table gives the share of visible points with an exact neighbourhood: the k-radius is right to one \
             part in ten thousand. *On the screen* means exact among the visible points, which is all that a search in \
             the picture can find. *In space* means exact among all points of the cloud. A neighbourhood is *cut \
             short* if it ends at a gap, at the bound on work, or because no point is near enough; such a \
             neighbourhood is not exact. The last columns give the number of points searched for and of iterations. k \
             = {K}, without culling.\n\n\
             | scene | method | exact on the screen | cut short | exact in space | points searched for | iterations |\n\
             |---|---|--:|--:|--:|--:|--:|\n"
        );
        for scene in self.scenes {
            for method in Method::ALL {
                let measured: Option<Outcome<Accuracy>> =
                    self.journal.get(&Task::Accuracy(method).key(scene, self.renderers));
                let Some(Accuracy { on_screen, in_space, cut_short, searched, iterations }) =
                    measured.and_then(Result::ok)
                else {
                    continue;
                };
                _ = writeln!(
                    page,
                    "| {} | {} | {} | {} | {} | {searched} | {} |",
                    scene.name,
                    method.name(),
                    percent(on_screen),
                    percent(cut_short),
                    percent(in_space),
                    if iterations > 0 { iterations.to_string() } else { String::new() }
                );
            }
        }
    }

    fn figure_6(&self, page: &mut String) {
        let folder = self.folder;
        let Some(scene) = self.scenes.iter().find(|scene| scene.name == "bunny") else { return };
        let Some(NormalError { points, mean, median, rmse, within_5, within_10, psnr }) =
            self.journal.get(&Task::Normals.key(scene, self.renderers))
        else {
            return;
        };
        _ = write!(
            page,
            "\n## Figure 6: normals on the fly and beforehand\n\n\
             ![on the fly; beforehand]({folder}/{FIGURE_6})\n\n\
             Left: normals from the visible points, estimated for this frame. Right: normals from all points, \
             estimated beforehand by the same estimator, k = {K}. The paper shows the pictures and observes \"a \
             similar visualization\", with \"minor artifacts due to information loss at silhouettes\". Here the angle \
             between both normals, over {points} points, has a mean of {mean:.2}°, a median of {median:.2}° and a root \
             mean square of {rmse:.2}°. It is below 5° for {} of the points and below 10° for {}. The pictures are {} \
             (PSNR).\n",
            percent(within_5),
            percent(within_10),
            psnr.map_or_else(|| "equal".into(), |psnr| format!("{psnr:.1} dB apart"))
        );
    }

    fn figure_7(&self, page: &mut String) {
        let folder = self.folder;
        let Some(Radii { large, small }) = self.journal.get(self.scales) else { return };
        _ = write!(
            page,
            "\n## Figure 7: two scales\n\n\
             ![surface; k-radius; single splats; nearer]({folder}/{FIGURE_7})\n\n\
             The small body has as many points as the large one. The pictures show the surface, the k-radius in \
             colours, splats made smaller so that each is visible, and the splats of the small body seven times as \
             near. No parameter states a size. The median k-radius is {large:.4} on the large body and {small:.4} on \
             the small one, a ratio of {:.1}.\n",
            large / small
        );
    }

    fn figure_9(&self, page: &mut String) {
        let Some(scene) = self.scenes.iter().find(|scene| scene.name == "imperia") else { return };
        if self.journal.get(&Task::Curvature.key(scene, self.renderers)) != Some(true) {
            return;
        }
        let folder = self.folder;
        _ = write!(
            page,
            "\n## Figure 9: curvature\n\n\
                  ![the statue; nearer; its curvature]({folder}/{FIGURE_9})\n\n\
                  The pictures show the statue, a part of it, and the surface variation of that part, which is \
                  computed with the normals in the same frame.\n"
        );
    }

    fn figure_10(&self, page: &mut String) {
        *page += "\n## Figure 10: time per stage\n\n\
                  The charts give the time of each stage for several k, with grid culling. The paper's chart has no \
                  numbers: its search takes most of the time and grows with k, and fitting costs about as much as \
                  splatting. Here the search takes most of the time with splat communication. With the screen grid it \
                  does not, and fitting always costs less than splatting. Times are medians of up to five frames; a \
                  frame of more than three seconds is measured once.\n\n";
        let folder = self.folder;
        for scene in self.scenes {
            for method in Method::BY_STAGE {
                if self.bars(scene, method).is_empty() {
                    continue;
                }
                _ = writeln!(page, "![{}, {}]({folder}/{})", scene.name, method.name(), chart_name(scene, method));
            }
        }
    }

    fn figure_11(&self, page: &mut String) {
        let folder = self.folder;
        let lines = self.convergence();
        if lines.is_empty() {
            return;
        }
        _ = write!(
            page,
            "\n## Figure 11: convergence of splat communication\n\n\
             ![points without a radius]({folder}/{CONVERGENCE})\n\n\
             The chart shows how many points have no k-radius yet before each iteration; k = {K}, without culling. The \
             paper needs 7 to 10 iterations for 99.9 % and observes that \"generally, 6–7 iterations already provide a \
             good quality\". The table gives the percentage of points that converged here after each iteration.\n\n| \
             scene |"
        );
        // The paper's chart shows the remaining points in percent.
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

    /// For each scene, the percentage of unfinished points before each iteration.
    fn convergence(&self) -> Vec<Line> {
        let line = |scene: &PaperScene| {
            let timing = self.timing(scene, Task::Table(Method::Communication, false))?.ok()?;
            let asked = f64::from(*timing.convergence.first()?);
            let left = &timing.convergence[..=iterations(&timing.convergence)];
            let points = left.iter().zip(1u32..).map(|(&left, at)| [f64::from(at), 100.0 * f64::from(left) / asked]);
            Some(Line { name: scene.name.into(), points: points.collect() })
        };
        self.scenes.iter().filter_map(line).collect()
    }

    /// Lists refused measurements and the reasons.
    fn refusals(&self, page: &mut String) {
        let mut lines = Vec::new();
        for scene in self.scenes {
            for task in tasks(scene, self.ks, self.ks) {
                let key = task.key(scene, self.renderers);
                if let Some(Err(why)) = self.journal.get::<Outcome<serde::de::IgnoredAny>>(&key) {
                    lines.push(format!("- {}, {}: {why}", scene.name, task.describe()));
                }
            }
        }
        if !lines.is_empty() {
            *page += "\n## What a device refused\n\n";
            *page += &lines.join("\n");
            *page += "\n";
        }
    }

    /// Milliseconds per stage, for each measured k.
    fn bars(&self, scene: &PaperScene, method: Method) -> Vec<(String, Vec<f64>)> {
        let bar = |&k: &u32| {
            let Some(Ok(timing)) = self.timing(scene, Task::Stages(method, k)) else { return None };
            let Timing { project, search, fit, splat, shade, .. } = timing;
            Some((k.to_string(), vec![project, search, fit, splat, shade]))
        };
        self.ks.iter().filter_map(bar).collect()
    }

    /// Writes the charts of the page.
    pub(super) fn write_charts(&self, folder: &Path) -> Result<(), Failure> {
        let labels = Labels { title: "splat communication", x: "iteration", y: "points without a k-radius, %" };
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
