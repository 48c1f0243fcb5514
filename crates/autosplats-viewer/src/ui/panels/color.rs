//! A colour button. egui's own button needs a glyph that egui's font lacks.

use eframe::egui::{self, Color32, DragValue, Popup, PopupCloseBehavior, Slider};

/// A button in a colour, with a popup to change it. Returns whether the colour was changed.
pub(super) fn button(ui: &mut egui::Ui, color: &mut [u8; 3], what: &str) -> bool {
    let size = egui::vec2(ui.spacing().interact_size.x, ui.spacing().interact_size.y);
    let (rect, response) = ui.allocate_exact_size(size, egui::Sense::click());
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Button, ui.is_enabled(), format!("Colour: {what}")));
    let stroke = ui.style().interact(&response).fg_stroke;
    let [r, g, b] = *color;
    ui.painter().rect(rect.shrink(1.0), 3.0, Color32::from_rgb(r, g, b), stroke, egui::StrokeKind::Inside);
    let before = *color;
    let popup = Popup::menu(&response).close_behavior(PopupCloseBehavior::CloseOnClickOutside);
    popup.show(|ui| {
        for (channel, name) in color.iter_mut().zip(["red", "green", "blue"]) {
            ui.add(Slider::new(channel, 0..=255).text(name));
        }
        code(ui, color);
    });
    response.on_hover_text(what);
    *color != before
}

/// The colour as web pages write it.
fn code(ui: &mut egui::Ui, color: &mut [u8; 3]) {
    let mut number = f64::from(u32::from_be_bytes([0, color[0], color[1], color[2]]));
    let field = DragValue::new(&mut number)
        .range(0..=0xff_ff_ff)
        .speed(0.0)
        .custom_formatter(|number, _| format!("#{:06x}", number as u32))
        .custom_parser(|text| parse(text).map(f64::from));
    if ui.add(field).on_hover_text("As web pages write it: #rrggbb").changed() {
        let [_, r, g, b] = (number as u32).to_be_bytes();
        *color = [r, g, b];
    }
}

/// Parses a colour of six hexadecimal digits.
fn parse(text: &str) -> Option<u32> {
    let digits = text.trim().trim_start_matches('#');
    let right = digits.len() == 6 && digits.bytes().all(|digit| digit.is_ascii_hexdigit());
    right.then(|| u32::from_str_radix(digits, 16).ok()).flatten()
}

#[cfg(test)]
mod tests {
    use super::parse;

    #[test]
    fn colours_are_six_digits() {
        assert_eq!([" #0a0B0c ", "ffffff"].map(parse), [Some(0x0a_0b_0c), Some(0xff_ff_ff)], "with a sign or without");
        assert_eq!(["#fff", "", "#gggggg", "+00000"].map(parse), [None; 4], "nothing else");
    }
}
