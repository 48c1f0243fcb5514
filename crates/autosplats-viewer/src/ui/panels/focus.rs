//! The keyboard focus: F6 moves it from part to part of the window, Tab from control to control.
//!
//! # How it works
//! Panels report their place in each frame; windows are layers of egui. A part is entered at its first control in the
//! last frame. The picture has the keyboard when no control has it, so that its keys need no modifiers.

use eframe::egui::{self, Context, Id, LayerId, Rect};

/// Places of the panels, and whether the keyboard moves the focus.
#[derive(Default)]
pub(crate) struct Focus {
    panels: Vec<Rect>,
    /// Whether keys have set the focus, which is then shown by a ring.
    pub(crate) by_keys: bool,
}

impl Focus {
    /// Starts a frame.
    pub(super) fn begin(&mut self) {
        self.panels.clear();
    }

    /// Reports a panel.
    pub(super) fn part(&mut self, rect: Rect) {
        self.panels.push(rect);
    }

    /// Moves the focus to the next part of the window, or with `back` to the previous one. `picture` is the place of
    /// the picture.
    pub(crate) fn next_part(&mut self, picture: Rect, context: &Context, back: bool) {
        let controls = controls(context);
        let mut windows: Vec<LayerId> = controls.iter().map(|(_, layer, _)| *layer).collect();
        windows.retain(|layer| layer.order == egui::Order::Middle);
        windows.dedup();
        let panels = self.panels.iter().filter(|panel| !picture.contains(panel.center()));
        let mut parts: Vec<WindowPart> = panels.map(|panel| WindowPart::Panel(*panel)).collect();
        parts.extend(windows.into_iter().map(WindowPart::Window));
        let first =
            |part: WindowPart| controls.iter().find(|(_, layer, rect)| part.holds(*layer, *rect)).map(|(id, ..)| *id);
        let stops: Vec<(WindowPart, Id)> = parts.into_iter().filter_map(|part| Some((part, first(part)?))).collect();
        let focused = context.memory(|memory| memory.focused());
        let here = focused.and_then(|focused| {
            let (_, layer, rect) = controls.iter().find(|(id, ..)| *id == focused)?;
            stops.iter().position(|(part, _)| part.holds(*layer, *rect))
        });
        // One stop more than there are parts: the picture.
        let count = stops.len() + 1;
        let place = here.unwrap_or(stops.len());
        let next = if back { place + count - 1 } else { place + 1 } % count;
        context.memory_mut(|memory| match (stops.get(next), focused) {
            (Some((_, id)), _) => memory.request_focus(*id),
            (None, Some(focused)) => memory.surrender_focus(focused),
            (None, None) => {}
        });
        self.by_keys = true;
    }

    /// Draws a ring around the focused control, if keys have set the focus.
    pub(super) fn ring(&mut self, context: &Context) {
        if context.input(|input| input.pointer.any_pressed()) {
            self.by_keys = false;
        }
        if !self.by_keys {
            return;
        }
        let focused = context.memory(|memory| memory.focused());
        let Some(widget) =
            focused.and_then(|id| context.viewport(|viewport| viewport.this_pass.widgets.get(id).copied()))
        else {
            return;
        };
        let painter = context.layer_painter(LayerId::new(egui::Order::Foreground, Id::unique("focus ring")));
        let color = context.global_style().visuals.selection.stroke.color;
        let rect = widget.interact_rect.expand(2.0);
        painter.rect_stroke(rect, 3.0, egui::Stroke::new(2.0, color), egui::StrokeKind::Middle);
    }
}

/// A part of the window, other than the picture.
#[derive(Clone, Copy, PartialEq)]
enum WindowPart {
    Panel(Rect),
    Window(LayerId),
}

impl WindowPart {
    fn holds(self, layer: LayerId, rect: Rect) -> bool {
        match self {
            Self::Panel(panel) => layer.order == egui::Order::Background && panel.contains(rect.center()),
            Self::Window(window) => layer == window,
        }
    }
}

/// The controls that can have the focus, in Tab order.
fn controls(context: &Context) -> Vec<(Id, LayerId, Rect)> {
    let order: Vec<LayerId> = context.memory(|memory| memory.layer_ids().collect());
    context.viewport(|viewport| {
        let mut layers: Vec<_> = viewport.prev_pass.widgets.layers().collect();
        // Panels first, then windows from the lowest to the topmost.
        layers.sort_by_key(|(layer, _)| (layer.order, order.iter().position(|own| own == *layer)));
        let all = layers.into_iter().flat_map(|(layer, widgets)| widgets.iter().map(move |widget| (*layer, widget)));
        let usable = all.filter(|(_, widget)| widget.enabled && widget.sense.is_focusable());
        usable.map(|(layer, widget)| (widget.id, layer, widget.rect)).collect()
    })
}
