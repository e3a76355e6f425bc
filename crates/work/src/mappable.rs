//! Which stored bases can be compared and mapped to each other: one check, whether a job asks or a request that is
//! answered at once.

use serde_json::Value;

/// What a spectrum is of.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SpectrumOf {
    /// The operator, every discretisation of the Laplacian being one.
    operator: String,
    /// The condition at the boundary; `None` where there is none.
    boundary: Option<String>,
}

/// Characters of an operator that a message tells.
const MOST_CHARACTERS: usize = 100;

impl SpectrumOf {
    /// That of a basis which a job with these parameters made, on a surface that is closed or not.
    pub fn new(parameters: &Value, closed: bool) -> Self {
        // Records of earlier versions have long lists in full.
        let mut parameters = parameters.clone();
        crate::abbreviate(&mut parameters);
        let operator = match &parameters["operator"] {
            Value::Null => "laplace".to_owned(),
            Value::String(name) if ["auto", "polygon", "robust"].contains(&&name[..]) => "laplace".to_owned(),
            Value::String(name) => name.clone(),
            other => other.to_string(),
        };
        let boundary = parameters["boundary"].as_str().unwrap_or("neumann");
        // A solid has a boundary, its surface, though that is closed.
        let bounded = !closed || operator == "volume";
        Self { operator, boundary: bounded.then(|| boundary.to_owned()) }
    }

    /// In words.
    pub fn in_words(&self) -> String {
        let mut operator: String = self.operator.chars().take(MOST_CHARACTERS).collect();
        if operator.len() < self.operator.len() {
            operator.push('…');
        }
        self.boundary.as_ref().map_or(operator.clone(), |boundary| format!("{operator}, {boundary}"))
    }
}

/// A stored basis, as far as it matters to what it can be mapped.
#[derive(Debug, Clone)]
pub struct StoredSpectrum {
    /// The identifier of the basis.
    pub basis: String,
    /// That of its mesh.
    pub mesh: String,
    /// What it is of.
    pub of: SpectrumOf,
    /// Whether its functions live inside a solid.
    pub is_of_solid: bool,
    /// The number of its first pair.
    pub first: u64,
}

/// Why bases cannot be mapped to each other.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Unmappable {
    /// It is of the inside of a solid.
    #[error("bases[{place}], {basis}, is of the interior of a solid; collections are of surfaces")]
    Solid {
        /// Its place.
        place: usize,
        /// The basis.
        basis: String,
    },
    /// It has no lowest pairs.
    #[error(
        "bases[{place}], {basis}, holds the pairs of an interval, starting at pair {first}; shapes are mapped by their lowest pairs"
    )]
    Interval {
        /// Its place.
        place: usize,
        /// The basis.
        basis: String,
        /// Its first pair.
        first: u64,
    },
    /// It was named before.
    #[error("bases[{place}] duplicates bases[{before}], {basis}")]
    Twice {
        /// Its place.
        place: usize,
        /// Its place before.
        before: usize,
        /// The basis.
        basis: String,
    },
    /// Its mesh is that of another.
    #[error("bases[{place}], {basis}, is of the mesh of bases[{before}], {other}")]
    SameMesh {
        /// Its place.
        place: usize,
        /// The basis.
        basis: String,
        /// The place of the other.
        before: usize,
        /// The other.
        other: String,
    },
    /// Two are of different operators, or of different conditions at a boundary.
    #[error(transparent)]
    Unlike(#[from] Unlike),
}

/// Two spectra that say nothing of each other.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("basis {} has a spectrum of {}, basis {} one of {}", bases[0], spectra[0], bases[1], spectra[1])]
pub struct Unlike {
    /// The two bases.
    pub bases: [String; 2],
    /// What their spectra are of.
    pub spectra: [String; 2],
}

/// Checks that all bases are of surfaces, each of another one, and that their lowest pairs are of one operator and one
/// condition at the boundary.
///
/// # Errors
/// [`Unmappable`] names the first that does not fit.
pub fn check_collection(bases: &[StoredSpectrum]) -> Result<(), Unmappable> {
    for (place, own) in bases.iter().enumerate() {
        let basis = own.basis.clone();
        if own.is_of_solid {
            return Err(Unmappable::Solid { place, basis });
        }
        if own.first > 0 {
            return Err(Unmappable::Interval { place, basis, first: own.first });
        }
        if let Some(before) = bases[..place].iter().position(|other| other.mesh == own.mesh) {
            let other = bases[before].basis.clone();
            return Err(match other == basis {
                true => Unmappable::Twice { place, before, basis },
                false => Unmappable::SameMesh { place, basis, before, other },
            });
        }
    }
    Ok(check_alike(bases.iter().map(|own| (own.basis.as_str(), &own.of)))?)
}

/// Checks that all spectra are of one operator and one condition at the boundary, where there is a boundary.
///
/// # Errors
/// [`Unlike`] names the first two that differ.
pub fn check_alike<'a>(bases: impl Iterator<Item = (&'a str, &'a SpectrumOf)> + Clone) -> Result<(), Unlike> {
    let with_boundary = bases.clone().find(|(_, of)| of.boundary.is_some());
    for (id, of) in bases.clone() {
        let other = bases.clone().next().filter(|(_, first)| first.operator != of.operator);
        let other = other.or(with_boundary.filter(|(_, first)| of.boundary.is_some() && first.boundary != of.boundary));
        if let Some((first, first_of)) = other {
            return Err(Unlike {
                bases: [first.to_owned(), id.to_owned()],
                spectra: [first_of.in_words(), of.in_words()],
            });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn stored(basis: &str, mesh: &str, parameters: &Value, closed: bool) -> StoredSpectrum {
        let of = SpectrumOf::new(parameters, closed);
        StoredSpectrum { basis: basis.to_owned(), mesh: mesh.to_owned(), of, is_of_solid: false, first: 0 }
    }

    #[test]
    fn a_collection_is_of_different_surfaces_and_of_one_operator() {
        let laplace = json!({"operator": "laplace"});
        let a = stored("a", "1", &laplace, true);
        let told = |bases: &[StoredSpectrum]| check_collection(bases).map_err(|refused| refused.to_string());
        assert_eq!(told(&[a.clone(), stored("b", "2", &json!({"operator": "robust"}), true)]), Ok(()));
        assert_eq!(told(&[a.clone(), a.clone()]), Err("bases[1] duplicates bases[0], a".to_owned()));
        let beside = stored("b", "1", &laplace, true);
        assert_eq!(told(&[a.clone(), beside]), Err("bases[1], b, is of the mesh of bases[0], a".to_owned()));
        let solid = StoredSpectrum { is_of_solid: true, ..stored("b", "2", &laplace, true) };
        assert!(told(&[a.clone(), solid]).unwrap_err().contains("interior of a solid"));
        let interval = StoredSpectrum { first: 7, ..stored("b", "2", &laplace, true) };
        assert!(told(&[a.clone(), interval]).unwrap_err().contains("starting at pair 7"));
        let hamiltonian = json!({"operator": {"hamiltonian": {"potential": {"curvature": {"t": 0.1}}}}});
        let refused = check_collection(&[a.clone(), stored("b", "2", &hamiltonian, true)]).unwrap_err();
        let Unmappable::Unlike(Unlike { bases, spectra }) = refused else { panic!("{refused:?}") };
        assert_eq!((bases, &spectra[0][..]), (["a".to_owned(), "b".to_owned()], "laplace"));
    }

    #[test]
    fn a_condition_matters_where_there_is_a_boundary() {
        let (neumann, dirichlet) = (json!({}), json!({"boundary": "dirichlet"}));
        let alike = |a: (&Value, bool), b: (&Value, bool)| {
            let of = [SpectrumOf::new(a.0, a.1), SpectrumOf::new(b.0, b.1)];
            check_alike(["a", "b"].into_iter().zip(&of)).is_ok()
        };
        assert!(alike((&neumann, true), (&dirichlet, false)));
        assert!(alike((&dirichlet, false), (&dirichlet, false)));
        assert!(!alike((&neumann, false), (&dirichlet, false)));
    }
}
