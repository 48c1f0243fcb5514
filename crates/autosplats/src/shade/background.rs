//! The background, and colours by their names.

use std::str::FromStr;

use crate::Error;

/// What to show where no surface is. Colours are sRGB, 8 bits a channel.
///
/// Text is parsed as a colour, as two for a gradient, or as `transparent`. A colour is one of CSS by its name,
/// `#rrggbb` or `#rgb`.
///
/// # Examples
///
/// ```
/// use autosplats::Background;
///
/// assert_eq!("white".parse::<Background>()?, Background::Color([255; 3]));
/// assert_eq!("#4a535f,black".parse::<Background>()?, Background::Gradient([0x4a, 0x53, 0x5f], [0; 3]));
/// # Ok::<(), autosplats::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case", try_from = "Written")]
pub enum Background {
    /// One colour.
    Color([u8; 3]),
    /// From the first colour at the top to the second at the bottom.
    Gradient([u8; 3], [u8; 3]),
    /// Nothing: alpha is 0.
    Transparent,
}

/// A background in a file: text, or numbers.
#[derive(serde::Deserialize)]
#[serde(untagged)]
enum Written {
    Text(String),
    Numbers(Numbers),
}

#[derive(serde::Deserialize)]
#[serde(rename_all = "snake_case")]
enum Numbers {
    Color([u8; 3]),
    Gradient([u8; 3], [u8; 3]),
}

impl TryFrom<Written> for Background {
    type Error = Error;

    fn try_from(written: Written) -> Result<Self, Error> {
        match written {
            Written::Text(text) => text.parse(),
            Written::Numbers(Numbers::Color(color)) => Ok(Self::Color(color)),
            Written::Numbers(Numbers::Gradient(top, bottom)) => Ok(Self::Gradient(top, bottom)),
        }
    }
}

impl FromStr for Background {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        if text.trim().eq_ignore_ascii_case("transparent") {
            return Ok(Self::Transparent);
        }
        let named = |name: &str| color(name.trim()).ok_or_else(|| Error::Background(text.into()));
        match text.split_once(',') {
            Some((top, bottom)) => Ok(Self::Gradient(named(top)?, named(bottom)?)),
            None => named(text).map(Self::Color),
        }
    }
}

/// A colour by its CSS name in any letter case, as `#rrggbb` or as `#rgb`.
fn color(text: &str) -> Option<[u8; 3]> {
    let mut words = CSS_COLORS.split_ascii_whitespace();
    let digits = match text.strip_prefix('#') {
        Some(short) if short.len() == 3 => &short.chars().flat_map(|digit| [digit; 2]).collect::<String>(),
        Some(digits) => digits,
        None => words.find(|name| name.eq_ignore_ascii_case(text)).and_then(|_| words.next())?,
    };
    if digits.len() != 6 || !digits.bytes().all(|digit| digit.is_ascii_hexdigit()) {
        return None;
    }
    let [_, red, green, blue] = u32::from_str_radix(digits, 16).ok()?.to_be_bytes();
    Some([red, green, blue])
}

/// The colours that CSS names, each with its six hexadecimal digits.
const CSS_COLORS: &str = "\
    aliceblue f0f8ff antiquewhite faebd7 aqua 00ffff aquamarine 7fffd4 azure f0ffff beige f5f5dc bisque ffe4c4 \
    black 000000 blanchedalmond ffebcd blue 0000ff blueviolet 8a2be2 brown a52a2a burlywood deb887 cadetblue 5f9ea0 \
    chartreuse 7fff00 chocolate d2691e coral ff7f50 cornflowerblue 6495ed cornsilk fff8dc crimson dc143c cyan 00ffff \
    darkblue 00008b darkcyan 008b8b darkgoldenrod b8860b darkgray a9a9a9 darkgreen 006400 darkgrey a9a9a9 \
    darkkhaki bdb76b darkmagenta 8b008b darkolivegreen 556b2f darkorange ff8c00 darkorchid 9932cc darkred 8b0000 \
    darksalmon e9967a darkseagreen 8fbc8f darkslateblue 483d8b darkslategray 2f4f4f darkslategrey 2f4f4f \
    darkturquoise 00ced1 darkviolet 9400d3 deeppink ff1493 deepskyblue 00bfff dimgray 696969 dimgrey 696969 \
    dodgerblue 1e90ff firebrick b22222 floralwhite fffaf0 forestgreen 228b22 fuchsia ff00ff gainsboro dcdcdc \
    ghostwhite f8f8ff gold ffd700 goldenrod daa520 gray 808080 green 008000 greenyellow adff2f grey 808080 \
    honeydew f0fff0 hotpink ff69b4 indianred cd5c5c indigo 4b0082 ivory fffff0 khaki f0e68c lavender e6e6fa \
    lavenderblush fff0f5 lawngreen 7cfc00 lemonchiffon fffacd lightblue add8e6 lightcoral f08080 lightcyan e0ffff \
    lightgoldenrodyellow fafad2 lightgray d3d3d3 lightgreen 90ee90 lightgrey d3d3d3 lightpink ffb6c1 \
    lightsalmon ffa07a lightseagreen 20b2aa lightskyblue 87cefa lightslategray 778899 lightslategrey 778899 \
    lightsteelblue b0c4de lightyellow ffffe0 lime 00ff00 limegreen 32cd32 linen faf0e6 magenta ff00ff maroon 800000 \
    mediumaquamarine 66cdaa mediumblue 0000cd mediumorchid ba55d3 mediumpurple 9370db mediumseagreen 3cb371 \
    mediumslateblue 7b68ee mediumspringgreen 00fa9a mediumturquoise 48d1cc mediumvioletred c71585 \
    midnightblue 191970 mintcream f5fffa mistyrose ffe4e1 moccasin ffe4b5 navajowhite ffdead navy 000080 \
    oldlace fdf5e6 olive 808000 olivedrab 6b8e23 orange ffa500 orangered ff4500 orchid da70d6 palegoldenrod eee8aa \
    palegreen 98fb98 paleturquoise afeeee palevioletred db7093 papayawhip ffefd5 peachpuff ffdab9 peru cd853f \
    pink ffc0cb plum dda0dd powderblue b0e0e6 purple 800080 rebeccapurple 663399 red ff0000 rosybrown bc8f8f \
    royalblue 4169e1 saddlebrown 8b4513 salmon fa8072 sandybrown f4a460 seagreen 2e8b57 seashell fff5ee \
    sienna a0522d silver c0c0c0 skyblue 87ceeb slateblue 6a5acd slategray 708090 slategrey 708090 snow fffafa \
    springgreen 00ff7f steelblue 4682b4 tan d2b48c teal 008080 thistle d8bfd8 tomato ff6347 turquoise 40e0d0 \
    violet ee82ee wheat f5deb3 white ffffff whitesmoke f5f5f5 yellow ffff00 yellowgreen 9acd32";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn backgrounds_by_name_and_number() {
        let background = |text: &str| text.parse().ok();
        let one = |color| Some(Background::Color(color));
        assert_eq!(background("white"), one([255; 3]), "a name");
        assert_eq!(background("RebeccaPurple"), one([0x66, 0x33, 0x99]), "in any letter case");
        assert_eq!(background("yellowgreen"), one([0x9a, 0xcd, 0x32]), "the last");
        assert_eq!(background("#0a141E"), one([10, 20, 30]), "digits");
        assert_eq!(background("#fA0"), one([255, 170, 0]), "the short form");
        let gradient = Some(Background::Gradient([0; 3], [255; 3]));
        assert_eq!(background("#000000,#ffffff"), gradient, "two colours");
        assert_eq!(background("black, white"), gradient, "two names");
        assert_eq!(background("transparent"), Some(Background::Transparent), "no colour");
        for bad in ["whit", "#ff", "#+12345", "#12345g", "000000", "ffffff", "white,", "#\u{e9}1", "", "a,b,c"] {
            assert_eq!(background(bad), None, "{bad} is no background");
        }
    }

    #[test]
    fn every_name_is_a_colour() {
        let words: Vec<&str> = CSS_COLORS.split_ascii_whitespace().collect();
        assert_eq!(words.len(), 2 * 148, "as many as CSS has");
        for pair in words.as_chunks::<2>().0 {
            assert_eq!(color(pair[0]), color(&format!("#{}", pair[1])), "{pair:?}");
        }
    }
}
