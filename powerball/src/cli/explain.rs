//! `powerball explain`: the residual loop.

use super::Failure;
use super::inputs::Inputs;
use clap::Args;
use std::path::PathBuf;

/// Find, name and add what the model lacks on logs; every addition is judged on another path.
#[derive(Args, Debug)]
pub(crate) struct Explain {
    #[command(flatten)]
    inputs: Inputs,
    /// Logs of another path, on which additions must hold.
    #[arg(long, value_name = "FILE", num_args = 1.., required = true)]
    validate: Vec<PathBuf>,
}

impl Explain {
    pub(crate) fn run(self) -> Result<(), Failure> {
        Err(Failure::Refused(format!("{:?}", (self.inputs, self.validate))))
    }
}
