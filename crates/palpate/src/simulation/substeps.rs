//! Steps that failed, tried again as several smaller ones.

use std::ops::AddAssign;
use std::sync::Arc;

use palpate_mechanics::{Dynamics, Failure, StageTimes, StepStats};
use palpate_model::Model;
use serde::{Deserialize, Serialize};

use super::{Simulation, SimulationError, StepReport};
use crate::mechanics::MechanicsError;

/// Most smaller steps that a failed one is divided into.
const MOST: u32 = 64;

/// Steps in a row without smaller ones after which the matrices for these are given up: they take as much memory
/// as those of whole steps, and as long to make again as a few steps take.
const LAPSE: u64 = 240;

/// What to do about a step that fails.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
pub enum Substeps {
    /// The step is an error.
    #[default]
    One,
    /// It is tried again from the last good state in 2, 4, 8, ... and at last 64 smaller steps; drives,
    /// tools and ends of springs move at a steady speed during these. Steps that blow tetrahedra up fail as
    /// well: turned over to more than their volume at rest, or ten times as large.
    Auto,
}

/// The bodies with a smaller time step.
pub(super) struct Finer {
    model: Arc<Model>,
    substeps: u32,
    dynamics: Dynamics,
    /// The last step that it was used for.
    step: u64,
}

impl Simulation {
    /// What to do when a step has failed, the state being that before it.
    pub(super) fn try_again(&mut self, failure: Failure) -> Result<StepReport, SimulationError> {
        let mut failure = failure;
        let mut substeps = 1;
        if self.options.substeps == Substeps::Auto {
            while substeps < MOST {
                substeps *= 2;
                match self.in_parts(substeps) {
                    Err(SimulationError::Mechanics(MechanicsError::Step(found))) => failure = found,
                    other => return other,
                }
            }
        }
        let (time, name) = (self.time(), self.model.bodies[failure.body].name.clone());
        Err(SimulationError::Step { time, substeps, name, failure })
    }

    /// One step as `substeps` smaller ones; nothing has changed after an error.
    fn in_parts(&mut self, substeps: u32) -> Result<StepReport, SimulationError> {
        let mut finer = self.finer(substeps)?;
        std::mem::swap(&mut self.dynamics, &mut finer.dynamics);
        let parts = self.advance_by_parts(substeps);
        std::mem::swap(&mut self.dynamics, &mut finer.dynamics);
        let taken = parts.and_then(|report| {
            self.dynamics.take_over(&finer.dynamics)?;
            Ok(report)
        });
        finer.step = self.dynamics.step_count();
        self.finer = Some(finer);
        let report = taken?;
        let (step, time) = (self.dynamics.step_count(), self.dynamics.time());
        Ok(StepReport { step, time, substeps, ..report })
    }

    fn advance_by_parts(&mut self, substeps: u32) -> Result<StepReport, SimulationError> {
        self.dynamics.set_strict(true);
        let mut all: Option<StepReport> = None;
        for left in (1..=substeps).rev() {
            let part = self.advance(left)?;
            all = Some(match all {
                Some(before) => together(&before, &part),
                None => part,
            });
        }
        Ok(all.expect("at least one part"))
    }

    /// Goes on with a model; matrices for smaller steps of another one are given up.
    pub(super) fn set_model(&mut self, model: Arc<Model>) {
        self.finer = self.finer.take().filter(|finer| Arc::ptr_eq(&finer.model, &model));
        self.model = model;
    }

    /// The bodies in the present state with a time step of so many parts: those of the last time if
    /// they serve.
    fn finer(&mut self, substeps: u32) -> Result<Box<Finer>, SimulationError> {
        let kept = self.finer.take().filter(|finer| finer.substeps == substeps);
        if let Some(mut finer) = kept {
            finer.dynamics.set_state(&self.dynamics.state())?;
            return Ok(finer);
        }
        let time_step = self.options.time_step / f64::from(substeps);
        let dynamics = self.dynamics.with_time_step(&self.model, time_step)?;
        let step = self.dynamics.step_count();
        Ok(Box::new(Finer { model: Arc::clone(&self.model), substeps, dynamics, step }))
    }

    /// Gives the matrices for smaller steps up when none was needed for long.
    pub(super) fn give_up_unused(&mut self) {
        let step = self.dynamics.step_count();
        let unused = |finer: &mut Box<Finer>| step.abs_diff(finer.step) >= LAPSE;
        drop(self.finer.take_if(unused));
    }
}

/// Two steps as one.
fn together(first: &StepReport, last: &StepReport) -> StepReport {
    let mut times = first.times;
    times += last.times;
    let mut mechanics = StepStats {
        iterations: first.mechanics.iterations + last.mechanics.iterations,
        contact_solves: first.mechanics.contact_solves + last.mechanics.contact_solves,
        newton_iterations: first.mechanics.newton_iterations + last.mechanics.newton_iterations,
        refactored: first.mechanics.refactored + last.mechanics.refactored,
        new_columns: first.mechanics.new_columns + last.mechanics.new_columns,
        times: first.mechanics.times,
        ..last.mechanics
    };
    add(&mut mechanics.times, &last.mechanics.times);
    StepReport { times, mechanics, max_depth: first.max_depth.max(last.max_depth), ..last.clone() }
}

fn add(sum: &mut StageTimes, other: &StageTimes) {
    let StageTimes { predict, filter, compliance, solve, advance, refactor } = sum;
    let stages = [predict, filter, compliance, solve, advance, refactor];
    let others =
        [other.predict, other.filter, other.compliance, other.solve, other.advance, other.refactor];
    for (stage, other) in stages.into_iter().zip(others) {
        stage.add_assign(other);
    }
}
