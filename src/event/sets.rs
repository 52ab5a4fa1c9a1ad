//! Active sets of many subsystems, which are short: to compare or to copy each with a call would cost more than all else.

/// Are they the same?
pub(super) fn same(a: &[Vec<usize>], b: &[Vec<usize>]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| same_set(a, b))
}

/// The same for one subsystem.
#[inline]
pub(super) fn same_set(a: &[usize], b: &[usize]) -> bool {
    match (a, b) {
        ([a], [b]) => a == b,
        ([a0, a1], [b0, b1]) => a0 == b0 && a1 == b1,
        _ => a == b,
    }
}

/// Copies `from`, of as many subsystems.
pub(super) fn copy(to: &mut [Vec<usize>], from: &[Vec<usize>]) {
    for (to, from) in to.iter_mut().zip(from) {
        match (&mut to[..], &from[..]) {
            ([to], [from]) => *to = *from,
            ([to0, to1], [from0, from1]) => (*to0, *to1) = (*from0, *from1),
            _ => to.clone_from(from),
        }
    }
}

/// The same where there may have been others.
pub(super) fn assign(to: &mut Vec<Vec<usize>>, from: &[Vec<usize>]) {
    to.resize(from.len(), Vec::new());
    copy(to, from);
}
