//! Colour maps: from a number in [0, 1] to a colour whose lightness tells the number.
//!
//! Anchors are our own, chosen so that lightness falls evenly; between them colours are mixed in OKLab (Ottosson 2020), where
//! equal steps look equal. Zero is the colour of the clay the meshes are made of: what does not move stays quiet.

/// Linear-light red, green, blue. Range: 0 to 1.
pub type Linear = [f32; 3];

/// The colour of meshes without values, sRGB.
pub const CLAY: u32 = 0xd9_d6_d0;

/// Which colours stand for values.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ColorMap {
    /// How far something moves: clay, gold, orange, crimson, plum.
    Warm,
    /// How wrong something is: clay, mint, teal, blue, indigo.
    Cool,
    /// Signed values, 0.5 is zero: blue on one side, clay between, red on the other.
    TwoSided,
}

impl ColorMap {
    /// The anchors, evenly spaced from 0 to 1, sRGB.
    pub fn anchors(self) -> &'static [u32] {
        match self {
            Self::Warm => &[CLAY, 0xf3_cf_7a, 0xf0_97_44, 0xd6_4a_4b, 0x93_1f_63, 0x45_0d_54],
            Self::Cool => &[CLAY, 0xa6_dc_b8, 0x4f_b8_b4, 0x2b_84_b8, 0x33_4f_a6, 0x2a_1a_6b],
            Self::TwoSided => &[
                0x1f_2f_7a, 0x3f_72_c4, 0x9c_c0_dd, CLAY, 0xec_ae_8c, 0xcb_4b_47, 0x72_12_3c,
            ],
        }
    }

    /// The colour of `value`; values outside [0, 1] take the nearest end, and what is not a number the colour of zero.
    pub fn color(self, value: f32) -> Linear {
        let anchors = self.anchors();
        let zero = if self == Self::TwoSided { 0.5 } else { 0.0 };
        let value = if value.is_nan() { zero } else { value.clamp(0.0, 1.0) };
        let place = value * (anchors.len() - 1) as f32;
        let i = (place as usize).min(anchors.len() - 2);
        let (a, b) = (
            lab_from_linear(linear_from_hex(anchors[i])),
            lab_from_linear(linear_from_hex(anchors[i + 1])),
        );
        let part = place - i as f32;
        linear_from_lab(core::array::from_fn(|c| a[c] + part * (b[c] - a[c])))
    }

    /// A CSS gradient from 0 to 1, left to right, for legends.
    pub fn css_gradient(self) -> String {
        let stops: Vec<String> = (0..=12).map(|i| css(self.color(i as f32 / 12.0))).collect();
        format!("linear-gradient(90deg,{})", stops.join(","))
    }
}

/// Linear light from 0xRRGGBB.
pub fn linear_from_hex(hex: u32) -> Linear {
    [16, 8, 0].map(|shift| {
        let s = (hex >> shift & 0xff) as f32 / 255.0;
        if s <= 0.040_45 {
            s / 12.92
        } else {
            ((s + 0.055) / 1.055).powf(2.4)
        }
    })
}

/// One sRGB byte from linear light.
pub(super) fn srgb_byte(linear: f32) -> u8 {
    let x = linear.clamp(0.0, 1.0);
    let s = if x <= 0.003_130_8 {
        12.92 * x
    } else {
        1.055 * x.powf(1.0 / 2.4) - 0.055
    };
    (s * 255.0 + 0.5) as u8
}

fn css(color: Linear) -> String {
    let [r, g, b] = color.map(srgb_byte);
    format!("#{r:02x}{g:02x}{b:02x}")
}

fn lab_from_linear([r, g, b]: Linear) -> [f32; 3] {
    let l = (0.412_221_47 * r + 0.536_332_54 * g + 0.051_445_993 * b).cbrt();
    let m = (0.211_903_5 * r + 0.680_699_5 * g + 0.107_396_96 * b).cbrt();
    let s = (0.088_302_46 * r + 0.281_718_84 * g + 0.629_978_7 * b).cbrt();
    [
        0.210_454_26 * l + 0.793_617_8 * m - 0.004_072_047 * s,
        1.977_998_5 * l - 2.428_592_2 * m + 0.450_593_7 * s,
        0.025_904_037 * l + 0.782_771_77 * m - 0.808_675_77 * s,
    ]
}

fn linear_from_lab([lightness, a, b]: [f32; 3]) -> Linear {
    let l = lightness + 0.396_337_78 * a + 0.215_803_76 * b;
    let m = lightness - 0.105_561_346 * a - 0.063_854_17 * b;
    let s = lightness - 0.089_484_18 * a - 1.291_485_5 * b;
    let [l, m, s] = [l * l * l, m * m * m, s * s * s];
    [
        (4.076_741_7 * l - 3.307_711_6 * m + 0.230_969_93 * s).clamp(0.0, 1.0),
        (-1.268_438 * l + 2.609_757_4 * m - 0.341_319_4 * s).clamp(0.0, 1.0),
        (-0.004_196_086 * l - 0.703_418_6 * m + 1.707_614_7 * s).clamp(0.0, 1.0),
    ]
}
