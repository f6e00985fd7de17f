# What a day's work asks for. Every line of a recipe can be copied into a shell; CONTRIBUTING.md says how to have `just`.

# The recipes.
default:
    @just --list

# The tests of one module, a folder of powerball/. `just test bus sdo`: those whose name has sdo.
test MODULE *TESTS:
    cargo test -p powerball-{{MODULE}} --all-features --locked -- {{TESTS}}

# Checks that take minutes: formatting, spelling, licences, lints, modules alone.
fast:
    .ci/fast

# All that must hold before a change lands.
ci:
    .ci/run

# Writes every golden and measured table anew. Look at the diff.
bless:
    DYNGEN_BLESS=1 cargo test -p dyngen --test golden
    DYNGEN_BLESS=1 cargo test --release -p dyngen --test operations
    DYNGEN_BLESS=1 cargo test -p dyngen-macros --test ui
    POWERBALL_BLESS=1 cargo test --release -p powerball-bus --features std --lib the_committed_table
    POWERBALL_BLESS=1 cargo test --release -p powerball --test bus_faults
    POWERBALL_BLESS=1 cargo test --release -p powerball-workspace --test firmware --test docs

# The documentation of the crates and the pages as a site.
docs:
    cargo doc --release --workspace --exclude powerball-benches --no-deps --lib && .ci/site

# Tests that take minutes each.
at-length:
    cargo test --release --workspace --exclude powerball-benches -- --ignored at_length
