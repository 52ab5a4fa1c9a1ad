//! The search for a sequence of modes: every source of candidates in one race, and one order of what they lead to.
//!
//! A problem with modes becomes smooth once it is said which modes hold when. That sequence is what is searched. A [`Space`] knows a kind of
//! sequence: where candidates come from, the program of one, the sequences next to one. [`explore`] knows only the trait. It gives its
//! [sources](Source) shares of the work, keeps what was found in one [total order](Rank), goes to neighbours in the order of their price, and ends
//! when more work is not worth what it costs, by the history of this problem.

mod budget;
mod early_termination;
mod explore;
mod rank;
mod sample;
mod space;

pub(crate) use budget::Budget;
pub(crate) use early_termination::{watched, EarlyTermination, Patience};
pub(crate) use explore::{explore, Ended, Found, Plan};
pub(crate) use rank::Rank;
pub(crate) use sample::Sampler;
pub(crate) use space::{Candidate, Limits, Neighbour, Source, Space};
