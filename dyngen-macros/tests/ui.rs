//! What the compiler says about a macro call that is wrong, and where.
//!
//! `TRYBUILD=overwrite cargo test -p dyngen-macros --test ui` accepts new messages.

use std::path::Path;

#[test]
fn errors_of_a_call_stand_where_they_belong() {
    // trybuild compiles in a crate of its own, whose folder is what paths are relative to.
    let crate_of_the_tests = Path::new(env!("CARGO_TARGET_TMPDIR")).join("../tests/trybuild/dyngen-macros");
    let arms = crate_of_the_tests.join("arms");
    std::fs::create_dir_all(&arms).unwrap();
    for name in ["slider.toml", "broken.toml"] {
        std::fs::copy(Path::new("tests/arms").join(name), arms.join(name)).unwrap();
    }
    let tests = trybuild::TestCases::new();
    tests.pass("tests/ui/pass/*.rs");
    tests.compile_fail("tests/ui/fail/*.rs");
}
