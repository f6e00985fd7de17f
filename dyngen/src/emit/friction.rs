//! Columns for friction in addition to the regressor: each motor's own terms, functions of its velocity
//! alone. A motor turns with its joint, but where a transmission says that it turns with several.

use super::docs;
use crate::arm::Arm;
use crate::exact::rational::to_f64;
use proc_macro2::{Ident, Literal, TokenStream};
use quote::{format_ident, quote};
use std::fmt;
use std::str::FromStr;

/// One friction term of every joint: its column, a function of the joint's velocity v.
#[derive(Clone, Debug, PartialEq)]
pub enum FrictionTerm {
    /// v
    Viscous,
    /// sign v, zero at standstill
    Coulomb,
    /// tanh(a·v) with the shape a, s/rad: one for all joints, or one for each.
    Tanh(Vec<f64>),
}

impl FrictionTerm {
    /// Whether the term fits an arm of n joints; the reason where it does not.
    ///
    /// # Errors
    /// Shapes that are no positive numbers, or as many as neither one nor the joints.
    pub fn check(&self, n: usize) -> Result<(), String> {
        let FrictionTerm::Tanh(shapes) = self else { return Ok(()) };
        if shapes.len() != 1 && shapes.len() != n {
            return Err(format!("{self}: {} shapes for {n} joints: give one, or one for each", shapes.len()));
        }
        match shapes.iter().find(|a| !(a.is_finite() && **a > 0.0)) {
            Some(wrong) => Err(format!("{self}: the shape {wrong} is not greater than zero")),
            None => Ok(()),
        }
    }
}

impl fmt::Display for FrictionTerm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            FrictionTerm::Viscous => f.write_str("viscous"),
            FrictionTerm::Coulomb => f.write_str("coulomb"),
            FrictionTerm::Tanh(shapes) => {
                f.write_str("tanh")?;
                shapes.iter().try_for_each(|a| write!(f, ":{a}"))
            }
        }
    }
}

impl FromStr for FrictionTerm {
    type Err = String;

    /// `viscous`, `coulomb`, or `tanh:` and its shapes, as in `tanh:216` or `tanh:216:180`.
    fn from_str(text: &str) -> Result<Self, String> {
        match text.split_once(':') {
            None if text == "viscous" => Ok(FrictionTerm::Viscous),
            None if text == "coulomb" => Ok(FrictionTerm::Coulomb),
            Some(("tanh", shapes)) => {
                let shape =
                    |a: &str| a.trim().parse().map_err(|_| format!("{text}: the shape '{a}' is no number"));
                shapes.split(':').map(shape).collect::<Result<_, String>>().map(FrictionTerm::Tanh)
            }
            _ => {
                Err(format!("there is no friction term '{text}': there are viscous, coulomb and tanh:SHAPE"))
            }
        }
    }
}

/// How the motors of the joints that move on their own turn with the coordinates, n × n: the identity without
/// transmissions.
pub(super) fn motor_velocities(arm: &Arm) -> Vec<Vec<f64>> {
    let (matrix, drives) = (arm.motor_velocity_matrix(), arm.drives());
    let row = |motor: usize| {
        let mut row = vec![0.0; arm.dof()];
        for (factor, drive) in matrix[motor].iter().zip(&drives) {
            row[drive.coordinate] += to_f64(&(factor * &drive.ratio));
        }
        row
    };
    arm.coordinates().into_iter().map(row).collect()
}

/// Σ factor·name.
fn sum<'a>(terms: impl Iterator<Item = (f64, &'a Ident)>) -> TokenStream {
    let terms = terms.filter(|(factor, _)| *factor != 0.0).map(|(factor, name)| {
        let number = Literal::f64_suffixed(factor);
        if factor == 1.0 { quote!(#name) } else { quote!(#name * nalgebra::convert::<f64, T>(#number)) }
    });
    let terms: Vec<TokenStream> = terms.collect();
    quote!(#(#terms)+*)
}

/// The items for some terms; none where there are no terms.
pub(super) fn items(terms: &[FrictionTerm], arm: &Arm) -> TokenStream {
    if terms.is_empty() {
        return quote!();
    }
    let count = Literal::usize_unsuffixed(terms.len());
    let coupled = (!arm.transmissions.is_empty()).then(|| motor_velocities(arm));
    let matrix = coupled.as_deref().map(matrix_constant);
    let sign = terms.contains(&FrictionTerm::Coulomb).then(sign_function);
    let columns = columns_function(terms, arm.dof(), coupled.as_deref());
    let friction = friction_function(arm.dof(), coupled.as_deref());
    quote! {
        /// Number of friction terms of a joint.
        pub const FRICTION_TERMS: usize = #count;

        #matrix

        #sign

        #columns

        #friction
    }
}

/// The constant that says how coupled motors turn.
fn matrix_constant(motors: &[Vec<f64>]) -> TokenStream {
    let rows = motors.iter().map(|row| {
        let row = row.iter().map(|x| Literal::f64_suffixed(*x));
        quote!([#(#row),*])
    });
    quote! {
        /// Motor i turns at the sum over joints j of `MOTOR_VELOCITIES[i][j]` times their velocities, on the
        /// joint's side of its gear.
        pub const MOTOR_VELOCITIES: [[f64; JOINTS]; JOINTS] = [#(#rows),*];
    }
}

/// The sign that Coulomb's term takes.
fn sign_function() -> TokenStream {
    quote! {
        /// −1, 0 or 1.
        fn sign<T: SimdRealField + Copy>(x: T) -> T {
            let (zero, one) = (T::zero(), T::one());
            one.select(x.simd_gt(zero), (-one).select(x.simd_lt(zero), zero))
        }
    }
}

/// `name1` to `nameN`
fn names(name: &str, n: usize) -> Vec<Ident> {
    (0..n).map(|i| format_ident!("{name}{}", i + 1)).collect()
}

/// The function of every motor's columns for n joints, n × terms; with the matrix of coupled motors.
fn columns_function(terms: &[FrictionTerm], n: usize, coupled: Option<&[Vec<f64>]>) -> TokenStream {
    let doc = docs::lines(&columns_doc(terms, coupled.is_some()));
    let joints = names("dq", n);
    let velocities = if coupled.is_some() { names("motor", n) } else { joints.clone() };
    let turned = coupled.map(|motors| {
        let of = motors.iter().map(|row| sum(row.iter().copied().zip(&joints)));
        quote!(#(let #velocities = #of;)*)
    });
    let columns = terms.iter().map(|term| column(term, &velocities));
    quote! {
        #(#[doc = #doc])*
        #[must_use]
        pub fn friction_columns<T: SimdRealField + Copy>(
            dq: &SVector<T, JOINTS>,
        ) -> SMatrix<T, JOINTS, FRICTION_TERMS> {
            let [[#(#joints),*]] = dq.data.0;
            #turned
            SMatrix::from_array_storage(ArrayStorage([#(#columns),*]))
        }
    }
}

/// What the columns are, and how a regression takes them.
pub(super) fn columns_doc(terms: &[FrictionTerm], is_coupled: bool) -> String {
    let (title, rows) = if is_coupled {
        (
            "Friction columns of every motor",
            "row i holds motor i's columns, so motor i's friction is this row times its coefficients.\nIn a \
             regression each column stands beside the regressor in the rows of every joint j, times \
             `MOTOR_VELOCITIES[i][j]`.",
        )
    } else {
        (
            "Friction columns of every joint",
            "row i holds joint i's columns, so joint i's friction is this row times its coefficients.\nIn a \
             regression they stand beside the regressor, each in its own joint's rows.",
        )
    };
    let list: String = terms.iter().enumerate().map(|(k, term)| format!("\n{}. `{term}`", k + 1)).collect();
    format!(
        "{title}, one for each column:\n{list}\n\n* `dq`: joint velocities, rad/s\n\n\
        Returns n × terms: {rows}"
    )
}

/// One term of motors with some velocities.
fn column(term: &FrictionTerm, velocities: &[Ident]) -> TokenStream {
    let entries = velocities.iter().enumerate().map(|(i, v)| match term {
        FrictionTerm::Viscous => quote!(#v),
        FrictionTerm::Coulomb => quote!(sign(#v)),
        FrictionTerm::Tanh(shapes) => {
            let shape = shapes.get(i).or(shapes.first()).copied().unwrap_or_default();
            let shape = Literal::f64_suffixed(shape);
            quote!((#v * nalgebra::convert::<f64, T>(#shape)).simd_tanh())
        }
    });
    quote!([#(#entries),*])
}

/// What the function of the joints' friction torques is.
pub(super) const FRICTION_DOC: &str = "Friction torques of all joints: each row of [`friction_columns`] \
     times the same row of\ncoefficients.\n\n* `dq`: joint velocities, rad/s\n\
     * `coefficients`: n × terms, N·m (N·m·s/rad where viscous)\n\n\
     Returns the torques, N·m, that the drives spend on friction.";

/// The function of the joints' friction torques, N·m; with coupled motors Mᵀ times theirs.
fn friction_function(n: usize, coupled: Option<&[Vec<f64>]>) -> TokenStream {
    let of_motors = quote!(friction_columns(dq).component_mul(coefficients).column_sum());
    let spent = coupled.map_or(of_motors.clone(), |motors| {
        let torques = names("f", n);
        let of = (0..n).map(|j| sum(motors.iter().map(|row| row[j]).zip(&torques)));
        quote! {
            let [[#(#torques),*]] = #of_motors.data.0;
            SVector::from_array_storage(ArrayStorage([[#(#of),*]]))
        }
    });
    let doc = docs::lines(FRICTION_DOC);
    quote! {
        #(#[doc = #doc])*
        #[must_use]
        pub fn friction<T: SimdRealField + Copy>(
            dq: &SVector<T, JOINTS>,
            coefficients: &SMatrix<T, JOINTS, FRICTION_TERMS>,
        ) -> SVector<T, JOINTS> {
            #spent
        }
    }
}
