//! Which graphics card to use: the setting `off | auto | NAME | INDEX`.

use std::fmt;
use std::str::FromStr;

/// Which adapter to use.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub enum GpuChoice {
    /// None: everything runs on the CPU.
    Off,
    /// The first hardware adapter, discrete before integrated, and only where it is faster than the CPU. Never one that
    /// is software itself.
    #[default]
    Auto,
    /// The adapter of this place in the list, from 0, wherever it can.
    Index(usize),
    /// The first adapter whose name contains this text, upper or lower case, wherever it can.
    Name(String),
}

impl FromStr for GpuChoice {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let text = text.trim();
        match text.to_lowercase().as_str() {
            "" => Err("one of: off, auto, the number of an adapter, a part of its name"),
            "off" => Ok(Self::Off),
            "auto" => Ok(Self::Auto),
            _ => Ok(text.parse().map_or_else(|_| Self::Name(text.to_owned()), Self::Index)),
        }
    }
}

impl fmt::Display for GpuChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Off => write!(f, "off"),
            Self::Auto => write!(f, "auto"),
            Self::Index(index) => write!(f, "{index}"),
            Self::Name(name) => write!(f, "{name}"),
        }
    }
}

impl GpuChoice {
    /// The place in the list of the adapter that is meant. `adapters` gives each one's name and rank: 0 for a discrete
    /// card, 1 for an integrated one, 2 for other hardware, `None` for software.
    #[cfg_attr(not(feature = "gpu"), allow(dead_code, reason = "only a build with the feature has adapters"))]
    pub(super) fn among(&self, adapters: &[(String, Option<u8>)]) -> Option<usize> {
        match self {
            Self::Off => None,
            Self::Auto => {
                let ranked = adapters.iter().enumerate().filter_map(|(place, (_, rank))| Some((rank.as_ref()?, place)));
                ranked.min().map(|(_, place)| place)
            }
            Self::Index(index) => (*index < adapters.len()).then_some(*index),
            Self::Name(part) => {
                let part = part.to_lowercase();
                adapters.iter().position(|(name, _)| name.to_lowercase().contains(&part))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_choice_is_read_in_every_form_and_written_back() {
        for (text, choice) in [
            ("off", GpuChoice::Off),
            ("AUTO", GpuChoice::Auto),
            (" 1 ", GpuChoice::Index(1)),
            ("GeForce RTX", GpuChoice::Name("GeForce RTX".into())),
        ] {
            let read: GpuChoice = text.parse().unwrap();
            assert_eq!(read, choice);
            assert_eq!(read.to_string().parse(), Ok(choice));
        }
        assert!("  ".parse::<GpuChoice>().is_err());
    }

    #[test]
    fn auto_takes_the_best_hardware_and_never_software() {
        let adapters: Vec<(String, Option<u8>)> =
            [("llvmpipe", None), ("Intel Arc", Some(1)), ("NVIDIA H200", Some(0)), ("NVIDIA L4", Some(0))]
                .map(|(name, rank)| (name.to_owned(), rank))
                .into();
        let place = |text: &str| text.parse::<GpuChoice>().unwrap().among(&adapters);
        assert_eq!(place("auto"), Some(2));
        assert_eq!(place("off"), None);
        assert_eq!(place("0"), Some(0));
        assert_eq!(place("4"), None);
        assert_eq!(place("nvidia l"), Some(3));
        assert_eq!(place("pipe"), Some(0));
        assert_eq!(place("radeon"), None);
        assert_eq!(GpuChoice::Auto.among(&adapters[..1]), None);
    }
}
