//! Options of a simulation from the settings of the library.

use super::{Ambiguity, Method, Options, Zeno};
use crate::settings::{AmbiguityPolicy, Integration, Settings, ZenoPolicy};

impl From<&Settings> for Options {
    /// Values outside of an enumeration count as its default: [`Settings::validate`] names them.
    fn from(s: &Settings) -> Options {
        let count = |v: i64| usize::try_from(v).unwrap_or(0);
        Options {
            rtol: vec![s.rtol],
            atol: vec![s.atol],
            h0: s.h_init,
            h_max: s.h_max,
            method: match Integration::from_i64(s.integration) {
                Some(Integration::Dp5) => Method::Dp5,
                Some(Integration::Dop853) => Method::Dop853,
                Some(Integration::Radau5) => Method::Radau5,
                Some(Integration::Auto) | None => Method::Auto,
            },
            max_steps: count(s.max_steps),
            max_log: count(s.max_switches),
            zeno: match ZenoPolicy::from_i64(s.zeno) {
                Some(ZenoPolicy::Stop) => Zeno::Stop,
                Some(ZenoPolicy::TimeStepping) => Zeno::TimeStepping,
                Some(ZenoPolicy::Continue) | None => Zeno::Continue,
            },
            ambiguity: match AmbiguityPolicy::from_i64(s.ambiguity) {
                Some(AmbiguityPolicy::Stop) => Ambiguity::Stop,
                Some(AmbiguityPolicy::Prefer) => Ambiguity::Prefer,
                Some(AmbiguityPolicy::First) | None => Ambiguity::First,
            },
            preferred: Vec::new(),
            dense: s.dense != 0,
            sensitivity: s.sensitivity != 0,
            adjoint: s.adjoint != 0,
            max_memory: count(s.max_memory),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defaults_are_the_same() {
        assert_eq!(Options::from(&Settings::default()), Options::default());
    }

    #[test]
    fn policies_have_the_same_names() {
        let mut s = Settings::default();
        for (zeno, z) in [("continue", Zeno::Continue), ("stop", Zeno::Stop), ("time_stepping", Zeno::TimeStepping)] {
            s.set_by_name("zeno", zeno).unwrap();
            assert_eq!(Options::from(&s).zeno, z);
        }
        for (name, a) in [("first", Ambiguity::First), ("stop", Ambiguity::Stop), ("prefer", Ambiguity::Prefer)] {
            s.set_by_name("ambiguity", name).unwrap();
            assert_eq!(Options::from(&s).ambiguity, a);
        }
    }

    #[test]
    fn every_option_arrives() {
        let mut s = Settings::default();
        for (name, value) in [
            ("integration", "radau5"),
            ("rtol", "1e-5"),
            ("atol", "1e-6"),
            ("h_init", "0.1"),
            ("h_max", "0.5"),
            ("max_steps", "7"),
            ("max_switches", "8"),
            ("zeno", "stop"),
            ("ambiguity", "stop"),
            ("dense", "on"),
            ("sensitivity", "on"),
            ("adjoint", "on"),
        ] {
            s.set_by_name(name, value).unwrap();
        }
        let o = Options::from(&s);
        assert_eq!((&o.rtol[..], &o.atol[..], o.h0, o.h_max), (&[1e-5][..], &[1e-6][..], 0.1, 0.5));
        assert_eq!((o.method, o.max_steps, o.max_log), (Method::Radau5, 7, 8));
        assert_eq!((o.zeno, o.ambiguity), (Zeno::Stop, Ambiguity::Stop));
        assert_eq!((o.dense, o.sensitivity, o.adjoint), (true, true, true));
    }
}
