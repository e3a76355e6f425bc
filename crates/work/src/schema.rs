//! The parameters of every kind of job as schemas of OpenAPI, made of the types that read them.
//!
//! Where parameters go by a method there is one object for each method, with those members alone that it takes: what
//! belongs to whom is read from the table by which the parser refuses the others.

use utoipa::openapi::schema::{ObjectBuilder, OneOfBuilder, Schema, Type};
use utoipa::openapi::{Ref, RefOr};
use utoipa::{PartialSchema, ToSchema};

use crate::eigenbasis::{self, MethodName};
use crate::{
    FieldBasisParameters, KINDS, MapCollectionParameters, OperatorFamilyParameters, PencilBasisParameters,
    VibrationBasisParameters, VibrationMethodName,
};

/// Schemas by name.
pub type Components = Vec<(String, RefOr<Schema>)>;

/// A method as a schema of its own.
struct Variant {
    /// The name of the schema.
    component: &'static str,
    /// The name of the method on the wire.
    method: &'static str,
    /// What it says.
    description: &'static str,
    /// Whether it is the method of parameters that name none.
    default: bool,
}

/// The name of the schema of the parameters of a kind of job; `None` where there is no such kind.
pub fn component(kind: &str) -> Option<&'static str> {
    let names = [
        "EigenbasisParameters",
        "FieldBasisParameters",
        "OperatorFamilyParameters",
        "VibrationBasisParameters",
        "PencilBasisParameters",
        "MapCollectionParameters",
    ];
    KINDS.iter().zip(names).find(|(own, _)| **own == kind).map(|(_, name)| name)
}

/// The schemas of all parameters of jobs: [`component`] names the one of each kind, the others are what it refers to.
pub fn components() -> Components {
    let mut found = Vec::new();
    <eigenbasis::Request as ToSchema>::schemas(&mut found);
    by_method(
        "EigenbasisParameters",
        &<eigenbasis::Request as PartialSchema>::schema(),
        EIGENBASIS,
        &mut found,
        |name, method| method == MethodName::Auto.name() || eigenbasis::takes(method, name),
    );
    <FieldBasisParameters as ToSchema>::schemas(&mut found);
    found.push(("FieldBasisParameters".to_owned(), <FieldBasisParameters as PartialSchema>::schema()));
    found.push(("MapCollectionParameters".to_owned(), <MapCollectionParameters as PartialSchema>::schema()));
    found.push(("OperatorFamilyParameters".to_owned(), <OperatorFamilyParameters as PartialSchema>::schema()));
    <PencilBasisParameters as ToSchema>::schemas(&mut found);
    found.push(("PencilBasisParameters".to_owned(), <PencilBasisParameters as PartialSchema>::schema()));
    <VibrationBasisParameters as ToSchema>::schemas(&mut found);
    by_method(
        "VibrationBasisParameters",
        &<VibrationBasisParameters as PartialSchema>::schema(),
        VIBRATION,
        &mut found,
        |name, method| VibrationBasisParameters::takes(method, name),
    );
    found
}

const EIGENBASIS: &[Variant] = &[
    Variant {
        component: "EigenbasisByAuto",
        method: MethodName::Auto.name(),
        description: "`hsim` where that is expected to take about a second or less, else `approximate`, and `hsim` after all where that misses its goal. A member that one method alone takes chooses that method.",
        default: true,
    },
    Variant {
        component: "EigenbasisByApproximation",
        method: MethodName::Approximate.name(),
        description: "The fast approximation: Ritz pairs in a subspace of locally supported functions, with an estimate and a bound for each.",
        default: false,
    },
    Variant {
        component: "EigenbasisByHsim",
        method: MethodName::Hsim.name(),
        description: "The hierarchical subspace iteration method: pairs to a tolerance, proven complete.",
        default: false,
    },
    Variant {
        component: "EigenbasisBySim",
        method: MethodName::Sim.name(),
        description: "Plain subspace iteration: a baseline.",
        default: false,
    },
];

const VIBRATION: &[Variant] = &[
    Variant {
        component: "VibrationByHsim",
        method: VibrationMethodName::Hsim.name(),
        description: "HSIM: modes to a tolerance, proven complete, dense.",
        default: true,
    },
    Variant {
        component: "VibrationByApproximation",
        method: VibrationMethodName::Approximate.name(),
        description: "The fast approximation: modes of a space of local functions, refined on the mesh.",
        default: false,
    },
];

/// The parameters as one of several objects, each with its `method` and the members that this one takes.
fn by_method(
    name: &str,
    flat: &RefOr<Schema>,
    variants: &[Variant],
    found: &mut Components,
    takes: impl Fn(&str, &str) -> bool,
) {
    let RefOr::T(Schema::Object(flat)) = flat else { return };
    let mut one_of = OneOfBuilder::new().description(flat.description.clone());
    for variant in variants {
        let mut object = flat.clone();
        object.description = Some(variant.description.to_owned());
        object.properties.retain(|member, _| takes(member, variant.method));
        let method = ObjectBuilder::new()
            .schema_type(Type::String)
            .description(Some("How it is computed."))
            .enum_values(Some([variant.method]))
            .default(variant.default.then(|| variant.method.into()));
        object.properties.insert("method".to_owned(), method.build().into());
        object.required = if variant.default { Vec::new() } else { vec!["method".to_owned()] };
        found.push((variant.component.to_owned(), Schema::Object(object).into()));
        one_of = one_of.item(Ref::from_schema_name(variant.component));
    }
    found.push((name.to_owned(), Schema::OneOf(one_of.build()).into()));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_and_every_method_has_a_schema() {
        let found = components();
        let named = |name: &str| found.iter().any(|(own, _)| own == name);
        assert!(KINDS.iter().all(|kind| component(kind).is_some_and(named)));
        for variant in EIGENBASIS.iter().chain(VIBRATION) {
            assert!(named(variant.component));
        }
        let member = |component: &str, member: &str| {
            found.iter().any(|(name, schema)| {
                name == component
                    && matches!(schema, RefOr::T(Schema::Object(object)) if object.properties.contains_key(member))
            })
        };
        assert!(member("EigenbasisByHsim", "below") && !member("EigenbasisByApproximation", "below"));
        assert!(member("VibrationByHsim", "tolerance") && !member("VibrationByApproximation", "tolerance"));
    }
}
