//! What a macro generates is clean under the strictest lints.
#![deny(warnings, missing_docs)]

pub mod arm {
    //! A slider on a turntable.
    dyngen_macros::arm!("tests/arms/slider.toml");
}

#[dyngen_macros::model(file = "tests/arms/slider.toml", parameters = symbolic)]
pub mod symbolic {
    //! As the module above, for any size.
}

#[test]
fn it_compiles_and_has_its_constants() {
    assert_eq!(arm::JOINTS, 2);
    assert_eq!(symbolic::PARAMETER_NAMES.len(), symbolic::PARAMETERS);
}
