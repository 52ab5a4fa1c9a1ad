//! What can depend on what, whatever the active set is: in systems of parts that do not touch most derivatives are zero.

use super::Field;

/// Inputs are numbered `x`, `p`, `u`, `t`; lists ascend.
pub(in crate::event) struct Supports {
    /// Of every state the inputs that its velocity depends on.
    pub(in crate::event) velocity: Vec<Vec<usize>>,
}

impl Field {
    /// Weights of a subsystem depend on what its indicators depend on and on the velocities of those states (6.17), and the velocity of
    /// a state on the weights of all subsystems that drive it.
    pub(in crate::event) fn supports(&self) -> Supports {
        let (nx, n_sub) = (self.nx, self.subs.len());
        // velocities, then weights: inputs that they depend on by themselves, and what else they depend on
        let mut own: Vec<Vec<usize>> = vec![Vec::new(); nx + n_sub];
        let mut others: Vec<Vec<usize>> = vec![Vec::new(); nx + n_sub];
        own.iter_mut().enumerate().take(nx).for_each(|(i, own)| own.extend(self.linear.fixed.inputs(i)));
        for (k, s) in self.subs.iter().enumerate() {
            s.rows.iter().for_each(|&row| others[row].push(nx + k));
            let inputs: Vec<usize> = (s.q0..s.q0 + s.n_q).flat_map(|j| self.gradients.entries(j).1).copied().collect();
            others[nx + k].extend(inputs.iter().filter(|i| **i < nx));
            own[nx + k].extend(inputs);
        }
        let mut all = reachable(&own, &others);
        all.truncate(nx);
        Supports { velocity: all }
    }
}

/// Of every node what can be reached from it: the union of `own` over the nodes that `next` leads to. Ascending, each once.
pub(in crate::event) fn reachable(own: &[Vec<usize>], next: &[Vec<usize>]) -> Vec<Vec<usize>> {
    let mut seen = vec![usize::MAX; next.len()];
    let from = |start: usize| {
        let (mut queue, mut at, mut all) = (vec![start], 0, Vec::new());
        seen[start] = start;
        while at < queue.len() {
            let node = queue[at];
            at += 1;
            all.extend_from_slice(&own[node]);
            for &n in &next[node] {
                if seen[n] != start {
                    seen[n] = start;
                    queue.push(n);
                }
            }
        }
        all.sort_unstable();
        all.dedup();
        all
    };
    (0..own.len()).map(from).collect()
}
