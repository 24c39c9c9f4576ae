//! Pictures as PNG, with fonts of their own: they are the same on every machine.

use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::{Options, Tree};

/// Pixels for each pixel of the SVG, so that texts are sharp.
const SCALE: u32 = 2;

/// Draws an SVG as PNG.
pub fn png(svg: &str) -> Result<Vec<u8>, String> {
    let cannot = |why: &dyn std::fmt::Display| format!("cannot draw: {why}");
    let mut options = Options::default();
    let fonts = options.fontdb_mut();
    for font in [ttf_noto_sans::REGULAR, ttf_noto_sans::BOLD] {
        fonts.load_font_data(font.to_vec());
    }
    fonts.set_sans_serif_family("Noto Sans");
    let tree = Tree::from_str(svg, &options).map_err(|error| cannot(&error))?;
    let size = tree.size().to_int_size();
    let pixels = Pixmap::new(size.width() * SCALE, size.height() * SCALE);
    let mut pixels = pixels.ok_or_else(|| cannot(&"the picture is too large"))?;
    let scale = Transform::from_scale(SCALE as f32, SCALE as f32);
    resvg::render(&tree, scale, &mut pixels.as_mut());
    pixels.encode_png().map_err(|error| cannot(&error))
}
