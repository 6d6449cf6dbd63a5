//! As-consistent-as-possible features of a sequence (method section 1).

/// Features of N shapes: log-rotation `r` (axis times angle, radians, **not** wrapped at pi) and stretch `S`.
#[derive(Debug, Clone)]
pub struct AcapFeatures {
    /// Shape: `[N][V][9]`: r_x r_y r_z, S_xx S_xy S_xz S_yy S_yz S_zz. The reference has r = 0, S = I.
    pub shapes: Vec<Vec<[f64; 9]>>,
}
