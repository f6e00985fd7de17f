//! The dynamics of the LWA 4P, generated while this crate is built, from `arm.toml`: Table 1, Eq. 12, and
//! Table 3 as a grouping.
//!
//! Three parameter sets, one module each, with the same functions. The code is proven equal to the Lagrangian
//! of Eq. 5 and 6, allocates nothing, and runs over any real scalar of nalgebra, several samples at once
//! included.

/// The 19 base parameters of the arm as built: the set to identify.
pub mod minimal {
    dyngen_macros::arm! { file = "arm.toml", parameters = minimal, batch = true }
}

/// The 29 parameters that remain where lengths and gear ratios stay symbols.
pub mod symbolic {
    dyngen_macros::arm! { file = "arm.toml", parameters = symbolic }
}

/// The paper's own 29 parameters, Table 3. Their columns have rank 19.
pub mod published {
    dyngen_macros::arm! { file = "arm.toml", parameters = published }
}
