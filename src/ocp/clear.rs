//! Grazing solutions: they touch a surface without crossing it, as a vehicle that passes a swamp close by. The smallest error of a simulation crosses
//! the surface, and so does the solution between the points of the method. The same modes are solved with a distance from the surface, and
//! an element begins where the state is closest to it. The distance is the smallest one with which a simulation of the controls follows the solution.

use super::moves::Sequence;
use super::optimality::OTHER;
use super::request::Request;
use super::solve::Start;
use super::{Ocp, OcpResult};
use crate::dcs::Dcs;
use crate::error::Result;
use crate::fesd::{Clearance, Piece};
use crate::nlp::Control;
use crate::stop;

/// Shares of the largest distance from a surface that are kept.
const SHARES: [f64; 4] = [1e-6, 1e-5, 1e-4, 1e-3];
/// Share of an element of the stage beside one that holds the state on a surface in which it goes across.
const ACROSS: f64 = 0.1;
/// The least share where the state goes across from a surface that it is held on: the way is as short as the distance, and programs with
/// elements that have next to no length are not solved well.
const WAY: f64 = 1e-4;
/// How often elements are divided where the state is closest to a surface.
const ROUNDS: usize = 4;
/// How many solves may fail.
const FAILED: usize = 2;

/// An element of the next program: the element it is a part of, its stage and length, and the cell that is closest where it begins.
#[derive(Clone, Copy)]
struct Part {
    piece: usize,
    stage: usize,
    h: f64,
    lowest: Option<usize>,
    /// Does it keep clear of what the element comes near, or is it the way across?
    keeps: bool,
    /// Is it in the region between, where two surfaces are crossed at once behind the element?
    between: bool,
}

/// The end of the last part is in the cells of another one: the way across, which keeps clear of nothing.
fn end_with(parts: &mut Vec<Part>, cells: Part) {
    let Some(last) = parts.last_mut() else { return };
    let (stage, h) = (last.stage, ACROSS * last.h);
    last.h -= h;
    parts.push(Part { stage, h, lowest: None, keeps: false, ..cells });
}

impl Ocp {
    /// The last answer with a distance from the surfaces that it touches; `None` where it touches none, or no distance leads to an answer that
    /// its controls lead to. Every solve on the way is told.
    pub(super) fn keep_clear(
        &self,
        request: &Request,
        tell: &mut dyn FnMut(&OcpResult),
        control: &mut Control,
    ) -> Result<Option<Box<Ocp>>> {
        let inside = Request { plain_branches: true, ..request.of_a_part() };
        let mut last: Option<Box<Ocp>> = None;
        let mut failed = 0;
        for share in SHARES {
            if failed > FAILED {
                break;
            }
            for round in 0..ROUNDS {
                let from = last.as_deref().unwrap_or(self);
                let Some(pieces) = from.pieces(share).filter(|_| stop::requested().is_none()) else { return Ok(None) };
                let across = pieces.iter().any(|p| p.held.contains(&true) || p.corner.is_some());
                if across && share < WAY {
                    break;
                }
                let dips = pieces.iter().any(|p| p.dip.is_some());
                if round > 0 && !dips || pieces.iter().all(|p| p.near.is_empty()) {
                    break;
                }
                let mut work = from.at_a_distance(&pieces, share, request)?;
                let next = work.run(Start::Lowest, &inside, control)?;
                tell(next);
                if !next.is_exact() {
                    failed += 1;
                    break;
                }
                last = Some(work);
            }
            if last.as_mut().map_or(Ok(false), |work| work.leads_to_it(request))? {
                return Ok(last);
            }
        }
        Ok(None)
    }

    /// Is the last answer on the other side of a surface that it touches, between the points of the method?
    pub(super) fn dips(&self) -> bool {
        self.pieces(SHARES[0]).is_some_and(|pieces| pieces.iter().any(|p| p.dip.is_some()))
    }

    /// Do the controls of the last answer lead elsewhere, in one of the stages?
    pub(super) fn leads_elsewhere(&mut self) -> Result<bool> {
        Ok(self.judged()?.is_some_and(|o| o.reason == OTHER))
    }

    /// Do the controls of the last answer lead to it, stage by stage and from the start to the end?
    pub(super) fn leads_to_it(&mut self, request: &Request) -> Result<bool> {
        if self.leads_elsewhere()? {
            return Ok(false);
        }
        Ok(self.simulated(request)?.is_none_or(|a| a.follows()))
    }

    /// The elements of the last answer.
    fn pieces(&self, share: f64) -> Option<Vec<Piece>> {
        let (b, r) = (self.built.as_ref()?, self.result.as_ref()?);
        let active: Vec<&[bool]> = r.trajectory.elements.iter().map(|e| &e.active_cells[..]).collect();
        b.problem.detects_switches().then(|| b.problem.pieces(&b.solver.solution().x, &active, share))
    }

    /// A copy of the problem that goes on from the last answer, whose elements are divided where they dip, with a distance from what they
    /// come near.
    fn at_a_distance(&self, pieces: &[Piece], share: f64, request: &Request) -> Result<Box<Ocp>> {
        let r = self.last_result()?;
        let form = Dcs::new(&self.system, request.options.form)?.form().clone();
        let (mut parts, mut carried): (Vec<Part>, f64) = (Vec::new(), 0.0);
        for (k, p) in pieces.iter().enumerate() {
            if let (true, Some(&before)) = (k > 0 && pieces[k - 1].corner.is_some(), parts.last()) {
                end_with(&mut parts, Part { between: true, ..before });
            }
            let h = p.h + std::mem::take(&mut carried);
            let begins = Part { piece: k, stage: p.stage, h, lowest: p.lowest, keeps: true, between: false };
            if p.held[0] {
                end_with(&mut parts, begins);
            }
            if let (true, Some(next)) = (p.held[1], pieces.get(k + 1)) {
                let h = ACROSS * next.h;
                carried = -h;
                let way = Part { stage: next.stage, h, lowest: None, keeps: false, ..begins };
                parts.extend([begins, way]);
                continue;
            }
            let Some((c, at)) = p.dip else {
                parts.push(begins);
                continue;
            };
            let at_start = p.lowest == Some(c);
            let at_end = pieces.get(k + 1).is_some_and(|next| next.lowest == Some(c));
            match parts.last_mut() {
                // where the state is closest has moved into this element
                Some(before) if at_start => {
                    before.h += at * p.h;
                    parts.push(Part { h: (1.0 - at) * p.h, ..begins });
                }
                _ if at_end => {
                    carried = (1.0 - at) * p.h;
                    parts.push(Part { h: at * p.h, ..begins });
                }
                _ => {
                    parts.push(Part { h: at * p.h, ..begins });
                    parts.push(Part { h: (1.0 - at) * p.h, lowest: Some(c), ..begins });
                }
            }
        }
        let mut clearance = Clearance { share, ..Clearance::default() };
        let mut s = Sequence { stages: vec![Vec::new(); self.n_stages] };
        for (element, part) in parts.iter().enumerate() {
            let p = &pieces[part.piece];
            clearance.lowest.extend(part.lowest.map(|c| (element, c)));
            let near = p.near.iter().filter(|_| part.keeps);
            clearance.least.extend(near.map(|&(c, least)| (element, c, least)));
            clearance.lengths.push(part.h);
            let active = p.corner.as_ref().filter(|_| part.between).unwrap_or(&p.active);
            clearance.active.extend_from_slice(active);
            s.stages[part.stage].push((active.clone(), part.h));
        }
        let mut work = Box::new(self.blank());
        work.carry_over(r)?;
        work.set_elements(&s.stages.iter().map(Vec::len).collect::<Vec<usize>>())?;
        work.modes = Some(s.modes(&form, &work.durations));
        work.clearance = Some(clearance);
        Ok(work)
    }
}
