//! The look panel: how the points are shown.

use autosplats::{Backend, Background, Backs, ColorMap, ColorMode, SearchEngine, Settings, usual_exposure};
use eframe::egui::{self, ComboBox, DragValue, Slider};

use crate::ui::Action;
use crate::view::{Look, Picture, TwoFingers, View};

/// Colour modes that every cloud has, or whose absence is reported.
const MODES: [(&str, ColorMode); 9] = [
    ("auto", ColorMode::Auto),
    ("colours", ColorMode::Rgb),
    ("plain", ColorMode::Plain),
    ("height", ColorMode::Height),
    ("normal", ColorMode::Normal),
    ("curvature", ColorMode::Curvature),
    ("radius", ColorMode::Radius),
    ("k-radius", ColorMode::KRadius),
    ("depth", ColorMode::Depth),
];

const MAPS: [(&str, Option<ColorMap>); 6] = [
    ("auto", None),
    ("viridis", Some(ColorMap::Viridis)),
    ("inferno", Some(ColorMap::Inferno)),
    ("turbo", Some(ColorMap::Turbo)),
    ("gray", Some(ColorMap::Gray)),
    ("reds", Some(ColorMap::Reds)),
];

const BACKENDS: [(&str, Backend); 3] = [("auto", Backend::Auto), ("CPU", Backend::Cpu), ("GPU", Backend::Gpu)];

/// What a two-finger drag on a touchpad does.
const FINGERS: [(&str, TwoFingers); 3] =
    [("zoom", TwoFingers::Zoom), ("orbit", TwoFingers::Orbit), ("pan", TwoFingers::Pan)];

/// Shows the panel. Returns its place.
pub(super) fn show(ui: &mut egui::Ui, view: &View, actions: &mut Vec<Action>) -> egui::Rect {
    let mut look = view.look.clone();
    let picture = view.shot.as_deref();
    let panel = egui::Panel::right("look").default_size(250.0).size_range(200.0..=420.0);
    let shown = panel.show(ui, |ui| {
        ui.add_space(4.0);
        ui.horizontal(|ui| {
            ui.strong("Look");
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                if ui.small_button("Reset").on_hover_text("Restore the defaults").clicked() {
                    look = Look::default();
                }
            });
        });
        ui.separator();
        egui::ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
            section(ui, "Colour", |ui| color(ui, &mut look, picture));
            section(ui, "Light", |ui| light(ui, &mut look, picture));
            section(ui, "Points", |ui| {
                ui.checkbox(&mut look.dots, "Raw points").on_hover_text("Dots instead of the surface (Tab)");
                ui.add(Slider::new(&mut look.dot_size, 1..=8).text("dot size").suffix(" px"));
            });
            section(ui, "Surface", |ui| surface(ui, &mut look.settings));
            section(ui, "Search", |ui| search(ui, &mut look, picture));
            section(ui, "Movement", |ui| {
                let mut rate = 1000.0 / look.moving_ms;
                let slider = Slider::new(&mut rate, 5.0..=60.0).text("pictures a second").fixed_decimals(0);
                if ui.add(slider).on_hover_text("Higher rates are smoother, but coarser while the view moves").changed()
                {
                    look.moving_ms = 1000.0 / rate;
                }
                choose(ui, "two fingers", &mut look.two_fingers, &FINGERS);
            });
        });
    });
    if look != view.look {
        actions.push(Action::SetLook(Box::new(look)));
    }
    shown.response.rect
}

fn section(ui: &mut egui::Ui, name: &str, content: impl FnOnce(&mut egui::Ui)) {
    egui::CollapsingHeader::new(name).default_open(name != "Search").show(ui, content);
}

fn choose<T: PartialEq + Clone>(ui: &mut egui::Ui, label: &str, value: &mut T, options: &[(&str, T)]) {
    let shown = options.iter().find(|(_, option)| option == value).map_or("…", |(name, _)| name);
    ComboBox::from_label(label).selected_text(shown).show_ui(ui, |ui| {
        for (name, option) in options {
            ui.selectable_value(value, option.clone(), *name);
        }
    });
}

fn color(ui: &mut egui::Ui, look: &mut Look, picture: Option<&Picture>) {
    let fields: Vec<String> = picture.map_or_else(Vec::new, |shot| shot.shown.field_names());
    let shading = &mut look.settings.shading;
    let mut options = MODES.to_vec();
    for field in &fields {
        let mode = if field == "Classification" { ColorMode::Classification } else { ColorMode::Field(field.clone()) };
        options.push((field, mode));
    }
    let missing = match &shading.color {
        ColorMode::Field(name) if !fields.contains(name) => Some(name.clone()),
        _ => None,
    };
    if let Some(name) = &missing {
        options.push((name, ColorMode::Field(name.clone())));
    }
    let before = shading.color.clone();
    choose(ui, "by", &mut shading.color, &options);
    if shading.color != before {
        // Another colour mode has another range of values.
        shading.range = None;
    }
    choose(ui, "map", &mut shading.color_map, &MAPS);
    let mut given = shading.range.is_some();
    ui.horizontal(|ui| {
        if ui.checkbox(&mut given, "range").on_hover_text("Otherwise the range of values in the picture").changed() {
            shading.range = given.then_some([0.0, 1.0]);
        }
        if let Some([low, high]) = &mut shading.range {
            let speed = (*high - *low).abs() * 0.01 + 1e-6;
            ui.add(DragValue::new(low).speed(speed));
            ui.add(DragValue::new(high).speed(speed));
            if !(*low < *high) {
                *high = *low + low.abs().max(1.0) * 1e-3;
            }
        }
    });
    ui.checkbox(&mut shading.legend, "Legend");
}

fn light(ui: &mut egui::Ui, look: &mut Look, picture: Option<&Picture>) {
    let shading = &mut look.settings.shading;
    ui.checkbox(&mut shading.lighting, "Light").on_hover_text("Otherwise colours are shown unchanged");
    ui.horizontal(|ui| {
        let mut given = shading.exposure.is_some();
        let hint = "Brightness of the points' own colours; by default only dark clouds are brightened";
        if ui.checkbox(&mut given, "exposure").on_hover_text(hint).changed() {
            let usual = picture.map_or(1.0, |shot| usual_exposure(&shot.shown.cloud));
            shading.exposure = given.then_some(usual);
        }
        if let Some(exposure) = &mut shading.exposure {
            ui.add(DragValue::new(exposure).speed(0.02).range(0.01..=100.0));
        }
    });
    ui.add(Slider::new(&mut shading.occlusion, 0.0..=4.0).text("occlusion"))
        .on_hover_text("Darkens creases and whatever lies behind an edge (eye-dome lighting)");
    let mut toned = shading.backs == Backs::Toned;
    let tone = ui.checkbox(&mut toned, "Darker backs");
    if tone.on_hover_text("Darkens the side of a surface that its sensor did not see, where that is known").changed() {
        shading.backs = if toned { Backs::Toned } else { Backs::Same };
    }
    ui.horizontal(|ui| {
        let (mut top, mut bottom) = match shading.background {
            Background::Color(color) => (color, color),
            Background::Gradient(top, bottom) => (top, bottom),
            Background::Transparent => ([0; 3], [0; 3]),
        };
        let top_changed = super::color::button(ui, &mut top, "At the top");
        let bottom_changed = super::color::button(ui, &mut bottom, "At the bottom");
        if top_changed || bottom_changed {
            shading.background = Background::Gradient(top, bottom);
        }
        ui.label("background");
    });
}

fn surface(ui: &mut egui::Ui, settings: &mut Settings) {
    let given = Settings::default().reconstruction;
    let reconstruction = &mut settings.reconstruction;
    ui.checkbox(&mut reconstruction.adaptive, "k auto")
        .on_hover_text("More neighbours where points are noisy; detects scan lines and outliers");
    ui.add(Slider::new(&mut reconstruction.k, 1..=64).text("k"))
        .on_hover_text("Number of neighbours that a splat is fitted to");
    ui.add(Slider::new(&mut reconstruction.splat_scale, 0.1..=4.0).logarithmic(true).text("splat size"));
    ui.add(Slider::new(&mut reconstruction.frames_averaged, 1..=32).text("frames averaged"))
        .on_hover_text("Averages live points that are noisy in each frame; slow motion lags behind");
    let mut two = reconstruction.points_per_pixel == 2;
    if ui.checkbox(&mut two, "Two points a pixel").on_hover_text("Better outlines and thin parts").changed() {
        reconstruction.points_per_pixel = if two { 2 } else { 1 };
    }
    let mut removed = reconstruction.outlier_expansions.is_some();
    if ui.checkbox(&mut removed, "Remove outliers").on_hover_text("Removes points that belong to no surface").changed()
    {
        reconstruction.outlier_expansions = removed.then(|| given.outlier_expansions.unwrap_or(1));
    }
    let mut open = reconstruction.gap_factor.is_some();
    if ui.checkbox(&mut open, "Gaps stay open").on_hover_text("Otherwise neighbours are taken across any gap").changed()
    {
        reconstruction.gap_factor = open.then(|| given.gap_factor.unwrap_or(4.0));
    }
    if let Some(factor) = &mut reconstruction.gap_factor {
        ui.add(Slider::new(factor, 1.5..=32.0).logarithmic(true).text("gap factor"));
    }
    ui.checkbox(&mut reconstruction.ellipses, "Ellipses").on_hover_text("Splats follow the spread of the neighbours");
}

fn search(ui: &mut egui::Ui, look: &mut Look, picture: Option<&Picture>) {
    choose(ui, "backend", &mut look.backend, &BACKENDS);
    let reconstruction = &mut look.settings.reconstruction;
    let first_radius = match reconstruction.engine {
        SearchEngine::KdTree { first_radius } => first_radius,
        _ => picture.map_or(0.01, |shot| first_radius(&shot.shown.cloud)),
    };
    let engines = [
        ("screen grid", SearchEngine::ScreenGrid),
        ("splat communication", SearchEngine::SplatCommunication),
        ("splat communication by raster", SearchEngine::SplatCommunicationRaster),
        ("kd-tree", SearchEngine::KdTree { first_radius }),
    ];
    choose(ui, "engine", &mut reconstruction.engine, &engines);
    if reconstruction.engine != SearchEngine::ScreenGrid {
        ui.weak("This engine runs on a GPU only.");
    }
    if let SearchEngine::KdTree { first_radius } = &mut reconstruction.engine {
        let speed = f64::from(*first_radius) * 0.01;
        ui.add(DragValue::new(first_radius).range(1e-9..=1e9).speed(speed).prefix("first radius "));
    }
    ui.checkbox(&mut reconstruction.grid_culling, "Grid culling")
        .on_hover_text("Skips points that are certainly hidden");
    ui.checkbox(&mut reconstruction.depth_refinement, "Depth refinement")
        .on_hover_text("Keeps splats of hidden points out of the surface");
    ui.checkbox(&mut reconstruction.trim, "Trim").on_hover_text("Ends silhouettes where the points end");
}

/// A radius that holds about ten points, as if the points covered a surface as wide as the cloud's diagonal.
fn first_radius(cloud: &autosplats::cloud::PointCloud) -> f32 {
    let step = (cloud.len() / 10_000).max(1);
    let finite = cloud.positions().iter().step_by(step).filter(|place| place.iter().all(|c| c.is_finite()));
    let none = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];
    let [low, high] = finite.fold(none, |[low, high], place| {
        [std::array::from_fn(|i| low[i].min(place[i])), std::array::from_fn(|i| high[i].max(place[i]))]
    });
    let diagonal = (0..3).map(|i| (high[i] - low[i]).powi(2)).sum::<f32>().sqrt();
    (diagonal * (10.0 / cloud.len().max(10) as f32).sqrt()).max(1e-9)
}
