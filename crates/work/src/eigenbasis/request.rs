//! The parameters as a client writes them: one flat object, of which each method takes its own members.

use chladni_spectral::basis::Precision;
use chladni_spectral::operator::{Boundary, MassKind, OperatorKind};
use chladni_spectral::spectrum::Refinement;
use chladni_spectral::spectrum::heat::HeatParameters;
use chladni_spectral::spectrum::radial::RadialParameters;
use serde::{Deserialize, Serialize};

use super::{Accuracy, Construction, Parts, Start, StorageKind};
use crate::ParameterError;
use crate::packed::Packed;

/// How eigenpairs are computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum MethodName {
    /// What is cheaper for the mesh and the count: the exact method where it takes about a second or less, else the
    /// approximation.
    #[default]
    Auto,
    /// The fast approximation: Ritz pairs in a subspace of locally supported functions.
    Approximate,
    /// The hierarchical subspace iteration method: pairs to a tolerance, proven complete.
    Hsim,
    /// Plain subspace iteration: a baseline.
    Sim,
}

impl MethodName {
    /// The name on the wire.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Approximate => "approximate",
            Self::Hsim => "hsim",
            Self::Sim => "sim",
        }
    }
}

/// How the hierarchical method goes about it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum HsimVariant {
    /// Better starting spaces, every group of eigenvalues with its own shift.
    #[default]
    Sliced,
    /// The thesis' Algorithms 1 to 3.
    Published,
}

/// Every member that some method takes; `None` is what was not given.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(default, deny_unknown_fields)]
pub struct Request {
    /// How the pairs are computed.
    #[cfg_attr(feature = "schema", schema(inline))]
    pub method: MethodName,
    /// Eigenpairs, the kernel included. 100, unless it is given or bounds take its place.
    #[cfg_attr(feature = "schema", schema(minimum = 1, maximum = 20000, example = 250))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub count: Option<usize>,
    /// All pairs below this eigenvalue, in 1/length² of the mesh, instead of a count.
    #[cfg_attr(feature = "schema", schema(example = 900.0))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub below: Option<f64>,
    /// `[from, to]`: all pairs of an interval, `from` included and `to` not, in 1/length² of the mesh, instead of a
    /// count. All below `to` are computed.
    #[cfg_attr(feature = "schema", schema(min_items = 2, max_items = 2, example = json!([100.0, 900.0])))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub between: Option<[f64; 2]>,
    /// With `below` or `between`: so many pairs below the upper bound, 1000 unless it is given.
    #[cfg_attr(feature = "schema", schema(minimum = 1, maximum = 20000, example = 400))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub at_most: Option<usize>,
    /// The operator; `auto`, unless it is given. `graph` and `hodge` take the method `hsim`, `volume` that and
    /// `approximate`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub operator: Option<OperatorKind>,
    /// The mass matrix; `barycentric`, unless it is given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mass: Option<MassKind>,
    /// What holds at the boundary; `neumann`, unless it is given. Functions take `neumann` or `dirichlet`; the fields
    /// of `hodge` take `tangential`, for which `neumann` is another name, or `normal`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub boundary: Option<Boundary>,
    /// Functions of the subspace, at least the count; twice the count and at least the count plus 150, unless it is
    /// given.
    #[cfg_attr(feature = "schema", schema(minimum = 1, maximum = 40000, example = 1000))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dimension: Option<usize>,
    /// How the subspace is built; `heat`, unless it is given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub construction: Option<Construction>,
    /// The largest relative error of an eigenvalue that is good enough, as estimated: columns are added until it is
    /// reached, at most five times. `standard`, unless it is given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub accuracy: Option<Accuracy>,
    /// Details of the construction `heat`. Where they are the usual ones, columns of few vertices diffuse for longer:
    /// `accuracy.heat_steps` of the result.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub heat: Option<HeatParameters>,
    /// Details of the construction `radial`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub radial: Option<RadialParameters>,
    /// Whether eigenvalues are counted once and each pair is enclosed with its index: `complete` is true then, or the
    /// job fails.
    #[cfg_attr(feature = "schema", schema(example = true))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub certify: Option<bool>,
    /// How the pairs are refined on the mesh; the basis is dense then. They are not, unless it is given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub refinement: Option<Refinement>,
    /// The largest residual ‖Sx − θMx‖ / ‖Sx‖ of a pair, 0.01 unless it is given.
    #[cfg_attr(feature = "schema", schema(minimum = 1e-10, maximum = 0.5, example = 1e-6))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tolerance: Option<f64>,
    /// How the hierarchical method goes about it; `sliced`, unless it is given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub variant: Option<HsimVariant>,
    /// Where plain subspace iteration starts; at `random` vectors, unless it is given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub start: Option<Start>,
    /// Levels of the hierarchy; by the size of the mesh and the count, unless it is given.
    #[cfg_attr(feature = "schema", schema(minimum = 1, maximum = 6, example = 3))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub levels: Option<usize>,
    /// How many samples the support of a function of the hierarchy holds on average.
    #[cfg_attr(feature = "schema", schema(minimum = 1, maximum = 100, example = 10.0))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sigma: Option<f64>,
    /// Of the variant `published`: where the shift lies between the eigenvalues that are known.
    #[cfg_attr(feature = "schema", schema(minimum = 0, maximum = 1, example = 0.4))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shift_ratio: Option<f64>,
    /// The size of the subspace that is iterated, over that of the pairs wanted.
    #[cfg_attr(feature = "schema", schema(minimum = 1, maximum = 4, example = 1.5))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub subspace_factor: Option<f64>,
    /// Into how many parts a server divides the job, for several workers to solve at once: a number, or `auto`. The job
    /// waits for its parts without a worker, and joins them. Not divided, unless it is given. Of `hsim` in the variant
    /// `sliced`, on surfaces, stored as columns: parts of 64 pairs at least, with the same result but for rounding. Of
    /// `approximate`, for the Laplacian by cotangents with a lumped mass: parts of the surface, with the same pairs and
    /// somewhat wider bounds.
    #[cfg_attr(feature = "schema", schema(inline))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub parts: Option<Parts>,
    /// How eigenfunctions are stored; `dense`, unless it is given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub storage: Option<StorageKind>,
    /// The type of the numbers of a dense basis. Unless it is given, `f32` where columns in single precision keep the
    /// tolerance, and `f64` where they do not, as below 1e-4 and on large meshes; eigenfields of `hodge` are stored in
    /// `f64`, and what inverse iteration refined in `f32`. With `f32` given, the certificate says what tolerance is
    /// kept.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub precision: Option<Precision>,
    /// Seeds everything that is drawn at random; 0, unless it is given.
    #[cfg_attr(feature = "schema", schema(example = 0))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
}

const APPROXIMATE: &[MethodName] = &[MethodName::Approximate];
const HSIM: &[MethodName] = &[MethodName::Hsim];
const SIM: &[MethodName] = &[MethodName::Sim];
const DIVISIBLE: &[MethodName] = &[MethodName::Hsim, MethodName::Approximate];
const EXACT: &[MethodName] = &[MethodName::Hsim, MethodName::Sim];

/// The members that not every method takes, with those that do.
const BELONGINGS: &[(&str, &[MethodName])] = &[
    ("dimension", APPROXIMATE),
    ("construction", APPROXIMATE),
    ("accuracy", APPROXIMATE),
    ("heat", APPROXIMATE),
    ("radial", APPROXIMATE),
    ("certify", APPROXIMATE),
    ("refinement", APPROXIMATE),
    ("below", HSIM),
    ("between", HSIM),
    ("at_most", HSIM),
    ("tolerance", EXACT),
    ("variant", HSIM),
    ("start", SIM),
    ("levels", HSIM),
    ("sigma", HSIM),
    ("shift_ratio", HSIM),
    ("subspace_factor", EXACT),
    ("storage", EXACT),
    ("parts", DIVISIBLE),
];

/// Whether a method, by its name on the wire, takes a member.
#[cfg(feature = "schema")]
pub fn takes(method: &str, member: &str) -> bool {
    BELONGINGS.iter().all(|(name, methods)| *name != member || methods.iter().any(|own| own.name() == method))
}

impl Request {
    /// Reads an object; `null` stands for an empty one.
    ///
    /// # Errors
    /// [`ParameterError::Form`] names a member that does not exist or does not parse, [`ParameterError::Value`] one
    /// that belongs to another method.
    pub fn read(value: &Packed) -> Result<Self, ParameterError> {
        let form = |reason| ParameterError::Form { kind: "eigenbasis", reason };
        match value {
            Packed::Null => return Ok(Self::default()),
            Packed::Object(_) => {}
            _ => return Err(form("expected a JSON object".to_owned())),
        }
        let given = |name: &str| value.get(name).is_some_and(|value| !value.is_null());
        let mut request: Self = match crate::plain::read(value) {
            Ok(request) => request,
            // What a member of another method should have been is of no use.
            Err(reason) => {
                let named = value.get("method").and_then(|name| crate::plain::read(name).ok());
                let misplaced = named.filter(|method| *method != MethodName::Auto).map(|method| placed(method, given));
                return Err(misplaced.and_then(Result::err).unwrap_or_else(|| form(reason)));
            }
        };
        if request.method == MethodName::Auto {
            request.method = request.method_of_members(given);
        }
        placed(request.method, given)?;
        Ok(request)
    }
}

/// Names the first given member that belongs to other methods.
fn placed(method: MethodName, given: impl Fn(&str) -> bool) -> Result<(), ParameterError> {
    for (name, methods) in BELONGINGS.iter().filter(|(name, _)| given(name)) {
        if !methods.contains(&method) {
            let owners: Vec<String> = methods.iter().map(|method| format!("\"{}\"", method.name())).collect();
            let reason = format!("belongs to the method {}, not to \"{}\"", owners.join(" and "), method.name());
            return Err(ParameterError::Value { name, reason });
        }
    }
    Ok(())
}

impl Request {
    /// The method that a request leaves open, where its members leave it open too: one that a single method takes names
    /// that method.
    fn method_of_members(&self, given: impl Fn(&str) -> bool) -> MethodName {
        let any_of = |group: &[MethodName]| BELONGINGS.iter().any(|(name, methods)| *methods == group && given(name));
        if any_of(APPROXIMATE) {
            MethodName::Approximate
        } else if any_of(HSIM)
            || any_of(EXACT)
            || self.precision.is_some()
            || self.parts.is_some()
            || self.operator.as_ref().is_some_and(|own| matches!(own, OperatorKind::Hodge | OperatorKind::Graph))
        {
            MethodName::Hsim
        } else if any_of(SIM) {
            MethodName::Sim
        } else {
            MethodName::Auto
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn every_member_is_some_method_s() {
        let common = ["method", "count", "operator", "mass", "boundary", "seed"];
        for (name, _) in BELONGINGS {
            assert!(!common.contains(name));
            // An unknown member would be refused as such; these are refused for their value or their method.
            let refused = Request::read(&Packed::from(&json!({"method": "magic", *name: []}))).unwrap_err().to_string();
            assert!(!refused.contains("unknown member"), "{name}: {refused}");
        }
    }
}
