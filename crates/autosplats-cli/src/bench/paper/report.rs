//! The page: tables, charts and text, from the journal alone.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

use super::chart::{Labels, Line, log_lines, stacked_bars};
use super::figures::{NormalError, Radii};
use super::journal::Journal;
use super::measure::{Accuracy, FirstRadius, K, KiddoTimes, Method, Outcome, Renderers, Timing, iterations};
use super::numbers::{percent, speedups};
use super::scenes::PaperScene;
use super::{FIGURE_6, FIGURE_7, FIGURE_9, FRAMES, Task, picture_name, tasks};
use crate::console::Console;
use crate::exit::Failure;
use crate::output::write_file;

/// File name of the chart of Figure 11.
const CONVERGENCE: &str = "figure-11.svg";

/// Input of the page.
pub(super) struct Report<'a> {
    pub(super) journal: &'a Journal,
    pub(super) renderers: &'a Renderers,
    pub(super) scenes: &'a [PaperScene],
    pub(super) ks: &'a [u32],
    /// Key of Figure 7 in the journal.
    pub(super) scales: &'a str,
    /// Name of the folder with pictures and charts, beside the page.
    pub(super) folder: &'a str,
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
            page += "**Quick run: scenes and pictures are small, and the figures are not representative.**\n\n";
        }
        page.push_str(
            "This page is written by `autosplats bench paper`; `autosplats bench paper --help` says how to repeat it. \
             The paper is Preiner, Jeschke and Wimmer, *Auto Splats*, 2012. It measured on a GeForce GTX 580 and an \
             Intel i7-930. This page was measured on:\n\n",
        );
        for device in self.renderers.describe() {
            _ = writeln!(page, "- {device}");
        }
        page += "\nScenes:\n\n\
                 | scene | the paper's points | visible there | points here | picture | origin |\n\
                 |---|--:|--:|--:|---|---|\n";
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
            "\n## Table 1: finding the {K} nearest neighbours\n\n\
             Times in milliseconds, medians of up to {FRAMES} frames after a first one that does not count. If the first \
             takes more than three seconds, it counts alone; it has no radii of a frame before. In brackets: microseconds per point searched for, which are the \
             reconstructed points, or all points for a kd-tree. \\* marks grid culling. Kd-trees hold all points and \
             are rebuilt in each frame, which is part of their time.\n\n\
             | scene | visible | reconstructed | paper: kd-tree | paper: Auto Splats |"
        );
        for method in Method::ALL {
            _ = write!(page, " {} |", method.name());
        }
        *page += " kiddo, CPU: visible points | all |\n|---|--:|--:|--:|--:|";
        *page += &"--:|".repeat(Method::ALL.len() + 2);
        *page += "\n";
        for scene in self.scenes {
            let kiddo: Option<KiddoTimes> = self.journal.get(&Task::Kiddo.key(scene, self.renderers));
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
                    Some(KiddoTimes { visible_ms, all_ms }) if !culled => {
                        _ = writeln!(page, " {visible_ms:.0} | {all_ms:.0} |");
                    }
                    _ => *page += " | |\n",
                }
            }
        }
    }

    /// Explains why the times differ from the paper's.
    fn why_times_differ(&self, page: &mut String) {
        *page += "\nWhy the times differ: the paper's figures come from a graphics card of 2012, which rasterises in \
             hardware. Splat communication by raster repeats that; the other form splats in compute shaders and finds \
             the same. Cards for data centres rasterise no faster than the GTX 580: of an H100, \"only two TPCs \
             [...] are graphics-capable\" (NVIDIA, *Hopper Architecture In-Depth*), 4 multiprocessors of 132, with 512 \
             lanes as the GTX 580 has.";
        if self.renderers.is_software() {
            *page += " The GPU here is a software renderer: it rasterises and blends on a few processor cores and \
                      waits after each pass. Its times say nothing about a graphics card. Ratios between its columns \
                      may, except those of splat communication by raster.";
        }
        *page += " The screen grid works differently from both: it reads neighbourhoods instead of drawing them in \
                  about ten iterations. It searches for visible points only, which a kd-tree of all points cannot \
                  know.\n";
    }

    /// Speedups as in the paper: the kd-tree's time over that of another search, per point and overall.
    fn ratios(&self, page: &mut String) {
        *page += "\n### Ratios on one device\n\n\
                  Ratios of search times. *Overall* is time over time. *By point*, as in the paper, divides the \
                  kd-tree's time by all points and the other time by the visible points. The paper states for splat \
                  communication against its kd-tree: bunny 1.47 by point and 1.56 overall, Imperia 1.37 and 2.57, \
                  horses 1.00 and 1.44, with culling 1.64 and 2.38. The kd-tree uses the fastest of the tried first \
                  radii that find 99.9 % of the k-radii.\n\n\
                  | scene | kd-tree's first radius, accuracy | kd-tree over splat communication: by point | overall | \
                  over that by raster: by point | overall | over screen grid: by point | overall | splat communication \
                  over screen grid | by raster |\n\
                  |---|---|--:|--:|--:|--:|--:|--:|--:|--:|\n";
        let mut missed = Vec::new();
        for scene in self.scenes {
            for culled in [false, true] {
                let of = |method| self.timing(scene, Task::Table(method, culled)).and_then(Result::ok);
                let [grid, communication, raster, tree] =
                    [Method::GridGpu, Method::Communication, Method::CommunicationRaster, Method::KdTree].map(of);
                let pair = |tree: &Option<Timing>, other: &Option<Timing>| match (tree, other) {
                    (Some(tree), Some(other)) => {
                        Some(speedups([tree.search, other.search], [tree.points, other.visible]))
                    }
                    _ => None,
                };
                let shown = |speedups: Option<[f64; 2]>| {
                    speedups.map_or_else(|| "– | –".into(), |[point, overall]| format!("{point:.2} | {overall:.2}"))
                };
                let one = |ratio: Option<f64>| ratio.map_or_else(|| "–".into(), |ratio| format!("{ratio:.1}"));
                let star = if culled { "\\*" } else { "" };
                let over_grid = pair(&tree, &grid);
                if let Some(ratios) = over_grid
                    && ratios.iter().any(|ratio| *ratio <= 1.0)
                {
                    missed.push(format!("{}{star}: the kd-tree is not slower than the screen grid", scene.name));
                }
                let over_search = |form: &Option<Timing>| match (form, &grid) {
                    (Some(form), Some(grid)) => Some(form.search / grid.search),
                    _ => None,
                };
                if over_search(&raster).is_some_and(|ratio| ratio < 10.0) {
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
                    "| {}{star} | {radius} | {} | {} | {} | {} | {} |",
                    scene.name,
                    shown(pair(&tree, &communication)),
                    shown(pair(&tree, &raster)),
                    shown(over_grid),
                    one(over_search(&communication)),
                    one(over_search(&raster))
                );
            }
        }
        if !missed.is_empty() {
            _ = writeln!(page, "\nTargets missed: {}.", missed.join("; "));
        }
    }

    fn culling(&self, page: &mut String) {
        *page += "\n## Grid culling\n\n\
                  Search time with culling over search time without, and the pixels that culling changes by more than \
                  two levels of 255. The paper has 71 instead of 117 ms (0.61) for the horses and 123 instead of 264 \
                  ms (0.47) for the cathedral.\n\n\
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
        *page += "\nWhy the ratios differ: the saving depends on the number of visible points behind others, which \
                  Table 1 shows (reconstructed out of visible). Points that the first depth map hides only by splats \
                  beyond silhouettes are put back, as holes would open without them. Splat communication iterates \
                  again for these points. The paper does not state what changes in its pictures.\n";
    }

    fn accuracy(&self, page: &mut String) {
        _ = write!(
            page,
            "\n## Accuracy\n\n\
             Fractions of the visible points with an exact neighbourhood, by a k-radius within 0.01 %. *On the screen* \
             is among visible points, which a search in the picture can find. *In space* is among all points of the \
             cloud: the difference is the price of searching in the picture, which the kd-tree does not pay. A \
             neighbourhood that ends at a gap or at the limit of work, or that has no point near enough, is not exact \
             but *cut short*. The last columns are the work. k = {K}, no culling.\n\n\
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
             Left: normals computed on the fly, among the visible points. Right: normals precomputed among all points \
             by the same estimator, k = {K}. The paper shows such pictures and observes \"a similar visualization\", \
             with \"minor artifacts due to information loss at silhouettes\". Angles between both normals of {points} \
             points: mean {mean:.2}°, median {median:.2}°, root mean square {rmse:.2}°; {} below 5°, {} below 10°. The \
             pictures are {} (PSNR).\n",
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
             Both bodies have equally many points. The pictures show the surface, the k-radius in colours, shrunken \
             splats that can be told apart, and those of the small body magnified seven times. No parameter states a \
             scale: the median k-radius is {large:.4} on the large body and {small:.4} on the small one, {:.1} to \
             one.\n",
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
             The statue, a closer view, and the surface variation there, computed in the same frame as the normals.\n"
        );
    }

    fn figure_10(&self, page: &mut String) {
        *page += "\n## Figure 10: time per stage\n\n\
                  With grid culling, for several values of k. The paper's chart has no numbers; the search takes most \
                  of the time and grows with k, and fitting costs about as much as splatting. Here the search takes \
                  most of the time with splat communication. With the screen grid its share grows with k. \
                  Fitting always costs less than splatting. Times are medians of up to five frames, or of a first \
                  frame of more than three seconds.\n\n";
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
             Points without a k-radius before each iteration, k = {K}, no culling. The paper states 7 to 10 iterations \
             to 99.9 %, and \"generally, 6–7 iterations already provide a good quality\". Converged points here, in \
             percent:\n\n\
             | scene |"
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
            // Both forms take the same iterations.
            let mut forms = Method::ALL.into_iter().filter(|method| method.communicates());
            let timing = forms.find_map(|form| self.timing(scene, Task::Table(form, false))?.ok())?;
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
            *page += "\n## Refused measurements\n\n";
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
    pub(super) fn write_charts(&self, folder: &Path, console: &Console) -> Result<(), Failure> {
        let labels =
            Labels { title: "splat communication", x: "iteration", y: "% of the points without a k-radius before it" };
        let lines = self.convergence();
        if !lines.is_empty() {
            let svg = log_lines(labels, &lines);
            write_file(&folder.join(CONVERGENCE), console, |writer| writer.write_all(svg.as_bytes()))?;
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
                write_file(&folder.join(chart_name(scene, method)), console, |writer| {
                    writer.write_all(svg.as_bytes())
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
