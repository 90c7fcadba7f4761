//! Which task steps which body.

use std::cmp::Reverse;
use std::collections::BTreeMap;

use crate::body::MovingBody;

/// What a step does for a node takes about as long as a solve takes for so many bytes of its factor.
const NODE_BYTES: usize = 1_000;

/// What a step of a body costs, in bytes read.
pub(super) fn cost(body: &MovingBody) -> usize {
    let factor = body.elastic().map_or(0, |elastic| elastic.factor_stats().bytes);
    factor + NODE_BYTES * body.positions.len()
}

/// The task of each body, by the processor that the model names and what it costs: the bodies of one
/// processor stay together, and processors, like bodies without one, go, dearest first, to the task with
/// the least to do.
pub(super) fn assign_tasks<P: Ord>(
    bodies: impl Iterator<Item = (Option<P>, usize)>,
    threads: usize,
) -> Vec<usize> {
    let mut groups: Vec<(usize, Vec<usize>)> = Vec::new();
    let mut group_of = BTreeMap::new();
    let mut count = 0;
    for (processor, cost) in bodies {
        let own = groups.len();
        let group = processor.map_or(own, |id| *group_of.entry(id).or_insert(own));
        if group == own {
            groups.push((0, Vec::new()));
        }
        groups[group].0 += cost;
        groups[group].1.push(count);
        count += 1;
    }
    groups.sort_by_key(|&(cost, _)| Reverse(cost));
    let mut load = vec![0; threads];
    let mut task_of = vec![0; count];
    for (cost, bodies) in groups {
        let task = (0..threads).min_by_key(|&task| load[task]).expect("at least one thread");
        load[task] += cost;
        for body in bodies {
            task_of[body] = task;
        }
    }
    task_of
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// The least that the task with most to do can have, of all ways to share the bodies.
    fn least(bodies: &[(Option<u8>, usize)], threads: usize) -> usize {
        let ways = threads.pow(bodies.len() as u32);
        let task = |way: usize, body: usize| way / threads.pow(body as u32) % threads;
        let is_allowed = |way: usize| {
            let together = |a: usize, b: usize| {
                bodies[a].0.is_none() || bodies[a].0 != bodies[b].0 || task(way, a) == task(way, b)
            };
            (0..bodies.len()).all(|a| (0..a).all(|b| together(a, b)))
        };
        let most = |way: usize| largest(bodies, threads, |body| task(way, body));
        (0..ways).filter(|&way| is_allowed(way)).map(most).min().unwrap_or(0)
    }

    fn largest(
        bodies: &[(Option<u8>, usize)],
        threads: usize,
        task: impl Fn(usize) -> usize,
    ) -> usize {
        let mut load = vec![0; threads];
        for (body, &(_, cost)) in bodies.iter().enumerate() {
            load[task(body)] += cost;
        }
        load.into_iter().max().unwrap_or(0)
    }

    proptest! {
        #[test]
        fn tasks_are_nearly_as_even_as_can_be(
            bodies in prop::collection::vec((prop::option::of(0_u8..4), 0_usize..100), 0..7),
            threads in 1_usize..4,
        ) {
            let tasks = assign_tasks(bodies.iter().copied(), threads);
            prop_assert_eq!(tasks.len(), bodies.len());
            for (a, &task) in bodies.iter().zip(&tasks) {
                prop_assert!(task < threads);
                for (b, &other) in bodies.iter().zip(&tasks) {
                    prop_assert!(a.0.is_none() || a.0 != b.0 || task == other);
                }
            }
            // Graham's bound (1969) for the dearest first.
            let most = largest(&bodies, threads, |body| tasks[body]);
            prop_assert!(3 * threads * most <= (4 * threads - 1) * least(&bodies, threads));
        }
    }
}
