//! The loop of the render thread: wait for requests, do the tasks, render the newest picture.

use std::sync::{Arc, PoisonError};
use std::time::Instant;

use autosplats::cloud::glam::DVec2;
use autosplats::cloud::{Axes, PointCloud, check_memory};
use autosplats::{
    Backend, ColorMode, Error, Frame, GBuffer, Image, Reconstruction, Renderer, SearchEngine, Settings,
    still_supersample,
};
use rayon::prelude::*;

use super::chosen::{Chosen, unless_too_large};
use super::exposure::Exposure;
use super::pace::{Costs, PointSubset, Reduction};
use super::task::{Goal, Outcome, PickHit, enlarge};
use super::{Answer, Depths, Outbox, Picture, Pixels, RenderRequest, Shared, Task, WindowDevice};
use crate::session::{ShownCloud, Sight, TreeHandle};

/// Colour that selected points are mixed with, sRGB.
const SELECTION_COLOR: [u16; 3] = [255, 140, 20];
/// Largest depth behind the surface at which a point still counts as seen, in splat radii.
const SEEN_DEPTH_RADII: f32 = 2.0;

pub(super) fn run(shared: &Shared, trees: &TreeHandle, outbox: &Outbox) {
    let mut studio = RenderState::new(trees.clone());
    loop {
        let work = {
            let mut post = shared.lock();
            loop {
                if post.closed {
                    return;
                }
                post.working = !post.tasks.is_empty() || post.wish.is_some() || studio.finer.is_some();
                if let Some(task) = post.tasks.pop_front() {
                    break RenderJob::Task(task);
                }
                if let Some(wish) = post.wish.take() {
                    break RenderJob::RenderRequest(wish);
                }
                if let Some(finer) = studio.finer.take() {
                    break RenderJob::Finer(finer);
                }
                post = shared.news.wait(post).unwrap_or_else(PoisonError::into_inner);
            }
        };
        studio.window = shared.window.get().filter(|_| !studio.is_window_lost).cloned();
        let finer = if let RenderJob::Finer(finer) = &work { Some(finer.clone()) } else { None };
        let work = std::panic::AssertUnwindSafe(|| match work {
            RenderJob::Task(task) => studio.perform(task, outbox).map(Answer::Done).map(Some),
            RenderJob::RenderRequest(wish) => studio.draw(&wish, outbox, &|| !shared.should_give_up(&wish)).map(Some),
            RenderJob::Finer(finer) => studio.refine(&finer, &|| !shared.has_news()),
        });
        // A panic in one picture must not end all pictures, as the window may hold unsaved edits.
        let Ok(answer) = std::panic::catch_unwind(work) else {
            studio = RenderState::new(trees.clone());
            outbox.send(Answer::Failed("this picture failed, which is a bug in this program".into()));
            continue;
        };
        match answer {
            // A supersampled picture interrupted by a task is rendered after it; a new wish drops it.
            Err(Error::Cancelled) => studio.finer = studio.finer.take().or(finer),
            Ok(None) => {}
            Ok(Some(answer)) => outbox.send(answer),
            Err(error) => {
                if matches!(error, Error::DeviceLost(_)) {
                    let lost = studio.renderer.take();
                    studio.is_window_lost |= lost.is_some_and(|chosen| chosen.is_of_window());
                }
                outbox.send(Answer::Failed(error.to_string()));
            }
        }
    }
}

/// The next piece of work.
enum RenderJob {
    Task(Task),
    RenderRequest(RenderRequest),
    Finer(Finer),
}

/// A request for the supersampled version of a finished picture at rest.
#[derive(Clone)]
struct Finer {
    wish: RenderRequest,
    settings: Settings,
}

/// State kept from picture to picture.
struct RenderState {
    trees: TreeHandle,
    /// The job for when nothing is requested.
    finer: Option<Finer>,
    /// The device of the window, if it is known and works.
    window: Option<WindowDevice>,
    is_window_lost: bool,
    renderer: Option<Chosen>,
    costs: Costs,
    shown: Option<(Option<Axes>, Arc<ShownCloud>)>,
    sparse: Option<PointSubset>,
    exposure: Exposure,
}

impl RenderState {
    fn new(trees: TreeHandle) -> Self {
        let (costs, exposure) = (Costs::default(), Exposure::default());
        Self {
            trees,
            finer: None,
            window: None,
            is_window_lost: false,
            renderer: None,
            costs,
            shown: None,
            sparse: None,
            exposure,
        }
    }

    /// The points that a wish shows; cached until they change.
    fn shown(&mut self, wish: &RenderRequest) -> Result<Arc<ShownCloud>, Error> {
        if let Some((axes, shown)) = &self.shown
            && *axes == wish.axes
            && shown.shows(&wish.document)
        {
            return Ok(Arc::clone(shown));
        }
        check_memory("what is shown", wish.document.shown_bytes() as u64)
            .map_err(|error| Error::NothingVisible(error.to_string()))?;
        let mut shown = wish.document.shown();
        if let Some(axes) = wish.axes.filter(|axes| shown.cloud.axes() != Some(*axes)) {
            shown.cloud = Arc::new(PointCloud::clone(&shown.cloud).with_axes(axes));
        }
        let shown = Arc::new(shown);
        self.shown = Some((wish.axes, Arc::clone(&shown)));
        self.sparse = None;
        Ok(shown)
    }

    fn renderer(&mut self, backend: Backend, outbox: &Outbox) -> Result<&mut Renderer, Error> {
        if self.renderer.as_ref().is_none_or(|chosen| chosen.backend != backend) {
            self.renderer = None;
            self.costs = Costs::default();
            let mut chosen = Chosen::new(backend, self.window.as_ref())?;
            outbox.send(Answer::Device(chosen.renderer().adapter()));
            self.renderer = Some(chosen);
        }
        Ok(self.renderer.as_mut().expect("it was made above").renderer())
    }

    /// Frees the renderer when there is nothing to draw, since its buffers are as large as the largest picture and
    /// cloud so far. A renderer on a GPU stays, as it takes long to create.
    fn free_renderer(&mut self) {
        self.renderer.take_if(|chosen| chosen.renderer().adapter().is_none());
        self.sparse = None;
    }

    /// Renderer settings for a task.
    fn settings(&mut self, wish: &RenderRequest, shown: &ShownCloud, outbox: &Outbox) -> Result<Settings, Error> {
        let gpu = self.renderer(wish.backend, outbox)?.adapter().is_some();
        let mut settings = settings(wish, &shown.cloud, gpu).0;
        let exposure = self.exposure.of(&wish.document, &shown.cloud);
        settings.shading.exposure.get_or_insert(exposure);
        // A task's picture is independent of the pictures before it.
        settings.reconstruction.frames_averaged = 1;
        settings.reconstruction.steady = false;
        Ok(settings)
    }

    /// Renders a picture. `go_on` returns false once another one is more urgent.
    fn draw(
        &mut self,
        wish: &RenderRequest,
        outbox: &Outbox,
        go_on: &(dyn Fn() -> bool + Sync),
    ) -> Result<Answer, Error> {
        let started = Instant::now();
        self.finer = None;
        let shown = self.shown(wish)?;
        if shown.cloud.is_empty() {
            self.free_renderer();
            return Ok(Answer::Empty);
        }
        let pixels = wish.size[0] as usize * wish.size[1] as usize;
        let pace = match wish.budget_ms {
            Some(budget) => self.costs.pace(shown.cloud.len(), pixels, budget),
            None => Reduction::WHOLE,
        };
        let gpu = self.renderer(wish.backend, outbox)?.adapter().is_some();
        let fits = |sparse: &PointSubset| (sparse.identity, sparse.halvings) == (shown.cloud.identity(), pace.halvings);
        if pace.halvings > 0 && !self.sparse.as_ref().is_some_and(fits) {
            self.sparse = Some(PointSubset::new(&shown, pace.halvings));
        }
        let exposure = self.exposure.of(&wish.document, &shown.cloud);
        let Self { renderer: Some(chosen), sparse, costs, finer, .. } = self else {
            return Ok(Answer::Empty);
        };
        let part = sparse.as_ref().filter(|_| pace.halvings > 0);
        let cloud = part.map_or(&*shown.cloud, |sparse| &sparse.cloud);
        let size = wish.rendered_size(pace.scale);
        let selected = Some(shown.selected(&wish.document)).filter(|selected| !selected.is_empty());
        let (mut settings, remark) = settings(wish, cloud, gpu);
        settings.shading.exposure.get_or_insert(exposure);
        // A GPU reads layers back only on request, which takes time. At rest the pointer needs depths.
        settings.all_layers = selected.is_some() || gpu && wish.budget_ms.is_none();
        // What is selected is tinted in memory.
        let texture = if selected.is_none() { chosen.texture(size)? } else { None };
        // A picture within its time limit is short.
        let turns = wish.budget_ms.is_none();
        let Frame { image, layers, counts, timings, .. } =
            chosen.render((cloud, &wish.camera), (size, texture.as_deref()), &settings, turns, go_on)?;
        let pixels = match texture {
            Some(texture) => Pixels::Texture { texture, supersample: 1 },
            None => {
                let Image { width, height, ref pixels, .. } = *image;
                let mut image = Image { width, height, pixels: pixels.clone(), linear: Vec::new() };
                if let Some(selected) = &selected {
                    tint(&mut image, layers, |point| {
                        let index = part.map_or(point, |sparse| sparse.indices[point as usize]);
                        selected.get(index as usize)
                    });
                }
                Pixels::Image(Arc::new(image))
            }
        };
        if wish.budget_ms.is_none() && wish.dots.is_none() && still_supersample(wish.size) > 1 {
            settings.all_layers = selected.is_some();
            // The supersampled picture keeps the value range of this one.
            settings.shading.range = settings.shading.range.or_else(|| counts.range());
            *finer = Some(Finer { wish: wish.clone(), settings });
        }
        let depths = Depths::new(layers);
        costs.learn(cloud.len(), size[0] as usize * size[1] as usize, timings.project, timings.frame - timings.project);
        Ok(Answer::Picture(Box::new(Picture {
            pixels,
            camera: wish.camera,
            size: wish.size,
            whole: pace == Reduction::WHOLE,
            dots: wish.dots.is_some(),
            counts,
            timings,
            remark,
            milliseconds: started.elapsed().as_secs_f64() * 1e3,
            most_points: costs.most_points(wish.budget_ms.unwrap_or(wish.moving_ms)),
            depths,
            shown,
        })))
    }

    /// Renders a picture again, supersampled. `go_on` returns false once something is requested. `None` if the size is
    /// too large for the device; the existing picture then stays.
    fn refine(&mut self, finer: &Finer, go_on: &(dyn Fn() -> bool + Sync)) -> Result<Option<Answer>, Error> {
        let Finer { wish, settings } = finer;
        let supersample = still_supersample(wish.size);
        let shown = self.shown(wish)?;
        let Some(chosen) = &mut self.renderer else { return Ok(None) };
        let size = wish.size.map(|side| side * supersample);
        let selected = shown.selected(&wish.document);
        let texture = if selected.is_empty() { chosen.texture(size) } else { Ok(None) };
        let Some(texture) = unless_too_large(texture)? else { return Ok(None) };
        let frame = chosen.render((&shown.cloud, &wish.camera), (size, texture.as_deref()), settings, true, go_on);
        let Some(frame) = unless_too_large(frame)? else { return Ok(None) };
        if let Some(texture) = texture {
            return Ok(Some(Answer::Finer(Pixels::Texture { texture, supersample })));
        }
        let image = if selected.is_empty() {
            frame.image.averaged(supersample)
        } else {
            let Image { width, height, ref pixels, .. } = *frame.image;
            let mut image = Image { width, height, pixels: pixels.clone(), linear: Vec::new() };
            tint(&mut image, frame.layers, |point| selected.get(point as usize));
            image.averaged(supersample)
        };
        Ok(Some(Answer::Finer(Pixels::Image(Arc::new(image)))))
    }

    fn perform(&mut self, task: Task, outbox: &Outbox) -> Result<Outcome, Error> {
        match task {
            Task::Pick { wish, pixel, purpose } => {
                let shown = self.shown(&wish)?;
                if shown.cloud.is_empty() {
                    return Ok(Outcome::Picked { purpose, point: None });
                }
                let settings = Settings { all_layers: true, ..self.settings(&wish, &shown, outbox)? };
                let layers = self
                    .renderer(wish.backend, outbox)?
                    .render(&shown.cloud, &wish.camera, wish.size, &settings)?
                    .layers;
                let [x, y] = [0, 1].map(|i| (pixel[i].max(0.0) as usize).min(wish.size[i] as usize - 1));
                // A click beside a thin object selects the object.
                let reach = 4isize;
                let near = (-reach..=reach).flat_map(|dy| (-reach..=reach).map(move |dx| (dx, dy)));
                let covered = near.filter_map(|(dx, dy)| {
                    let x = x.checked_add_signed(dx).filter(|&x| x < wish.size[0] as usize)?;
                    let y = y.checked_add_signed(dy).filter(|&y| y < wish.size[1] as usize)?;
                    let at = layers.index(x, y);
                    (layers.point[at] != u32::MAX).then_some((dx * dx + dy * dy, x, y, at))
                });
                let point = covered.min_by_key(|&(distance, ..)| distance).and_then(|(_, x, y, at)| {
                    let depth = f64::from(layers.depth[at]);
                    let pixel = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
                    let surface = wish.camera.unproject(pixel, depth, wish.size).ok()?;
                    Some(PickHit { index: layers.point[at] as usize, shown: Arc::clone(&shown), surface })
                });
                Ok(Outcome::Picked { purpose, point })
            }
            Task::Select { wish, region, through, mode } => {
                let shown = self.shown(&wish)?;
                let settings = Settings { all_layers: true, ..self.settings(&wish, &shown, outbox)? };
                let lens = wish.camera.lens(wish.size)?;
                let layers = if through {
                    None
                } else {
                    Some(
                        self.renderer(wish.backend, outbox)?
                            .render(&shown.cloud, &wish.camera, wish.size, &settings)?
                            .layers,
                    )
                };
                let hit = |index: usize| {
                    let Some((pixel, depth)) = lens.to_pixel(shown.cloud.world_position(index)) else { return false };
                    let pixel = [pixel.x as f32, pixel.y as f32];
                    if !region.contains(pixel) {
                        return false;
                    }
                    let inside = (0..2).all(|i| pixel[i] >= 0.0 && pixel[i] < wish.size[i] as f32);
                    inside
                        && layers.is_none_or(|layers| {
                            let at = layers.index(pixel[0] as usize, pixel[1] as usize);
                            let margin = SEEN_DEPTH_RADII * layers.radius.get(at).copied().unwrap_or(0.0);
                            layers.weight[at] > 0.0 && depth as f32 <= layers.depth[at] + margin
                        })
                };
                let hits = (0..shown.cloud.len()).into_par_iter().map(hit).collect();
                Ok(Outcome::Selected { shown, hits, mode })
            }
            Task::Photograph { mut wish, goal } => {
                let sight = Sight::new(wish.camera, wish.size, &wish.settings.shading.color);
                wish.document = self.trees.completed(&wish.document, sight).map_err(Error::NothingVisible)?;
                let shown = self.shown(&wish)?;
                let mut settings = self.settings(&wish, &shown, outbox)?;
                // Pictures of a film follow each other, so that they are steadied.
                let is_film = matches!(goal, Goal::Film(_));
                settings.reconstruction.steady = is_film;
                let size = wish.rendered_size(1.0);
                let renderer = self.renderer(wish.backend, outbox)?;
                let mut render = |supersample: u32| {
                    let size = size.map(|side| side * supersample);
                    let frame = renderer.render(&shown.cloud, &wish.camera, size, &settings)?;
                    let image = match supersample {
                        1 => enlarge(frame.image, wish.size),
                        _ => frame.image.averaged(supersample),
                    };
                    Ok((Box::new(image), frame.counts.range()))
                };
                let supersample = if is_film || wish.dots.is_some() { 1 } else { still_supersample(wish.size) };
                let (image, range) = match render(supersample) {
                    Err(Error::DeviceLimit { .. } | Error::DeviceMemory(_)) if supersample > 1 => render(1)?,
                    rendered => rendered?,
                };
                Ok(Outcome::Photographed { image, range, goal })
            }
        }
    }
}

/// Mixes the pixels of selected points with the selection colour.
fn tint(image: &mut Image, layers: &GBuffer, is_selected: impl Fn(u32) -> bool) {
    let width = image.width as usize;
    for (y, row) in image.pixels.chunks_mut(width).enumerate() {
        for (x, pixel) in row.iter_mut().enumerate() {
            let point = layers.point[layers.index(x, y)];
            if point != u32::MAX && is_selected(point) {
                let mixed = |i: usize| ((2 * u16::from(pixel[i]) + 3 * SELECTION_COLOR[i]) / 5) as u8;
                *pixel = [mixed(0), mixed(1), mixed(2), u8::MAX];
            }
        }
    }
}

/// The renderer settings for a wish, and a remark on what was replaced. Settings that these points or this device do
/// not support are replaced, since a look is kept from file to file.
fn settings(wish: &RenderRequest, cloud: &PointCloud, gpu: bool) -> (Settings, Option<String>) {
    let mut settings = wish.settings.clone();
    let mut remark = None;
    let missing = match &settings.shading.color {
        ColorMode::Rgb if cloud.colors().is_none() => Some("colours"),
        ColorMode::Classification if cloud.field("Classification").is_none() => Some("Classification"),
        ColorMode::Field(name) if cloud.field(name).is_none() => Some(&**name),
        _ => None,
    };
    if let Some(missing) = missing {
        remark = Some(format!("these points have no {missing}"));
        settings.shading.color = ColorMode::Auto;
        settings.shading.range = None;
    }
    if !gpu && settings.reconstruction.engine != SearchEngine::ScreenGrid {
        remark = Some("this search runs on a GPU only".into());
        settings.reconstruction.engine = SearchEngine::ScreenGrid;
    }
    let most = cloud.len().saturating_sub(1).clamp(1, 64) as u32;
    if wish.dots.is_some() {
        // Dots cost only a search for one neighbour.
        settings.reconstruction = Reconstruction {
            k: 1,
            splat_scale: 0.01,
            outlier_expansions: None,
            gap_factor: None,
            depth_refinement: false,
            trim: true,
            engine: SearchEngine::ScreenGrid,
            ..Reconstruction::paper()
        };
        settings.shading.lighting = false;
        settings.shading.occlusion = 0.0;
    }
    settings.reconstruction.k = settings.reconstruction.k.min(most);
    (settings, remark)
}

#[cfg(test)]
mod tests {
    use autosplats::cloud::glam::DVec3;
    use autosplats::{Camera, Projection};

    use std::sync::{Condvar, Mutex, OnceLock};

    use super::*;
    use crate::session::Document;

    fn wish(color: ColorMode, engine: SearchEngine) -> RenderRequest {
        let projection = Projection::PerspectiveFovDeg(40.0);
        let camera = Camera { eye: DVec3::NEG_Y, look_at: DVec3::ZERO, up: DVec3::Z, projection };
        let mut settings = Settings::default();
        settings.shading.color = color;
        settings.reconstruction.engine = engine;
        let document = Document::default();
        let backend = Backend::Cpu;
        let (dots, axes, budget_ms, moving_ms) = (None, None, None, 33.0);
        RenderRequest { document, camera, size: [8, 8], settings, dots, backend, axes, budget_ms, moving_ms }
    }

    #[test]
    fn a_whole_picture_is_given_up_when_the_view_moves() {
        let whole = wish(ColorMode::Auto, SearchEngine::ScreenGrid);
        let moving = RenderRequest { budget_ms: Some(30.0), ..whole.clone() };
        let shared = Shared { post: Mutex::default(), news: Condvar::new(), window: OnceLock::new() };
        let post = |wish: Option<&RenderRequest>| shared.lock().wish = wish.cloned();
        assert!(!shared.should_give_up(&whole), "nothing is asked for");
        post(Some(&whole));
        assert!(!shared.should_give_up(&whole), "another whole picture can wait");
        post(Some(&moving));
        assert!(shared.should_give_up(&whole), "it moves");
        assert!(!shared.should_give_up(&moving), "or nothing would be seen while it moves");
        post(None);
        shared.lock().closed = true;
        assert!(shared.should_give_up(&moving), "nobody looks any more");
    }

    #[test]
    fn a_look_that_cannot_be_had_is_replaced_and_told() {
        let cloud = PointCloud::new(DVec3::ZERO, vec![[0.0; 3]; 5]);
        for color in [ColorMode::Rgb, ColorMode::Classification, ColorMode::Field("Intensity".into())] {
            let (settings, remark) = settings(&wish(color.clone(), SearchEngine::ScreenGrid), &cloud, false);
            assert_eq!(settings.shading.color, ColorMode::Auto, "instead of {color:?}");
            assert!(remark.is_some(), "told for {color:?}");
            assert_eq!(settings.reconstruction.k, 4, "no more neighbours than there are");
        }
        let height = wish(ColorMode::Height, SearchEngine::SplatCommunication);
        let (on_cpu, remark) = settings(&height, &cloud, false);
        assert_eq!(on_cpu.reconstruction.engine, SearchEngine::ScreenGrid, "the CPU has one engine");
        assert!(remark.is_some(), "told");
        let (on_gpu, remark) = settings(&height, &cloud, true);
        assert_eq!(on_gpu.reconstruction.engine, SearchEngine::SplatCommunication, "a GPU has it");
        assert_eq!((on_gpu.shading.color, remark), (ColorMode::Height, None), "and nothing is to be told");
    }
}
