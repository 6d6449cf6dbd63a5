//! Batch: many instances of one basis, played by as many threads as the caller lends. No thread is made here and none waits.

mod claims;

use crate::basis::Basis;
use crate::controls::Controls;
use crate::error::FrameError;
use crate::frame::{Frame, FrameOutcome};
use crate::workspace::Workspace;
use claims::Claims;

/// One instance: its controls, its workspace, its output. All instances may share one basis.
#[derive(Debug)]
pub struct Instance<'i> {
    /// The opened package.
    pub basis: &'i Basis<'i>,
    /// Weights of the components.
    pub controls: Controls<'i>,
    /// Memory of its frames.
    pub workspace: Workspace<'i>,
    /// Output: deformed positions. Shape: `[V]`, source order, units of the source.
    pub positions: &'i mut [[f32; 3]],
    /// Output: unit vertex normals, where wanted. Shape: `[V]`, source order.
    pub normals: Option<&'i mut [[f32; 3]]>,
    /// How its last frame went; none before the first.
    pub outcome: Option<Result<FrameOutcome, FrameError>>,
}

impl Instance<'_> {
    /// Plays one frame, as [`Frame`] does, and keeps its outcome.
    pub fn play(&mut self) {
        let job = Frame {
            basis: self.basis,
            controls: &self.controls,
            positions: self.positions,
            normals: self.normals.as_deref_mut(),
        };
        self.outcome = Some(job.run(&mut self.workspace));
    }
}

/// A round of work over a slice. Any number of threads may call [`Batch::work`] or [`Batch::play`] on one batch, in any order;
/// every element is worked on once, by the thread that comes first. Elements do not see each other, so the results have
/// the same bits whatever the number of threads.
///
/// ```
/// use sinew_runtime::Batch;
/// let mut jobs = [1, 2, 3, 4, 5];
/// let batch = Batch::new(&mut jobs);
/// std::thread::scope(|scope| {
///     for _ in 0..2 {
///         scope.spawn(|| batch.work(|job| *job *= 10));
///     }
///     batch.work(|job| *job *= 10); // this thread helps
/// });
/// assert_eq!(jobs, [10, 20, 30, 40, 50]);
/// ```
#[derive(Debug)]
pub struct Batch<'s, T> {
    claims: Claims<'s, T>,
}

impl<'s, T> Batch<'s, T> {
    /// A round over all elements, none of them done.
    pub fn new(elements: &'s mut [T]) -> Self {
        Self {
            claims: Claims::new(elements),
        }
    }

    /// Works on elements until none is left, and returns how many it had. Others may still be at theirs: the round is over when
    /// every call has returned.
    pub fn work(&self, mut work: impl FnMut(&mut T)) -> usize {
        let mut count = 0;
        while let Some(element) = self.claims.take() {
            work(element);
            count += 1;
        }
        count
    }
}

impl Batch<'_, Instance<'_>> {
    /// Plays a frame of instances until none is left, and returns how many it played. What became of each is in its `outcome`.
    pub fn play(&self) -> usize {
        self.work(Instance::play)
    }
}

#[cfg(test)]
mod tests {
    use std::vec;
    use std::vec::Vec;

    use super::*;
    use crate::fixture::{Package, memory_for, open};

    const INSTANCES: usize = 23;

    /// Plays three frames of every instance on so many threads; positions and normals of all.
    fn play(basis: &Basis<'_>, threads: usize) -> Vec<[Vec<[f32; 3]>; 2]> {
        let mut memories: Vec<Vec<u8>> = (0..INSTANCES).map(|_| memory_for(basis)).collect();
        let mut weights = vec![[0.0; Package::COMPONENTS]; INSTANCES];
        let mut outputs = vec![[(); 2].map(|()| vec![[0.0; 3]; basis.vertex_count()]); INSTANCES];
        let parts = memories.iter_mut().zip(&mut weights).zip(&mut outputs);
        let mut instances: Vec<Instance<'_>> = parts
            .map(|((memory, weights), [positions, normals])| Instance {
                basis,
                controls: Controls::new(basis, weights).unwrap(),
                workspace: Workspace::new(basis, memory).unwrap(),
                positions,
                normals: Some(normals),
                outcome: None,
            })
            .collect();
        for frame in 0..3 {
            for (n, instance) in instances.iter_mut().enumerate() {
                instance
                    .controls
                    .set(n % Package::COMPONENTS, (n + frame) as f32 * 0.07 - 0.8)
                    .unwrap();
            }
            let batch = Batch::new(&mut instances);
            let played: usize = std::thread::scope(|scope| {
                let threads: Vec<_> = (0..threads).map(|_| scope.spawn(|| batch.play())).collect();
                threads.into_iter().map(|thread| thread.join().unwrap()).sum()
            });
            assert_eq!(played, INSTANCES);
            assert_eq!(batch.play(), 0, "the round is over");
            assert!(instances.iter().all(|instance| matches!(instance.outcome, Some(Ok(_)))));
        }
        drop(instances);
        outputs
    }

    #[test]
    fn any_number_of_threads_gives_the_same_bits() {
        let package = Package::small(1);
        let basis = open(&package);
        let alone = play(&basis, 1);
        assert!(alone.windows(2).all(|pair| pair[0] != pair[1]), "instances differ");
        for threads in [2, 3, 8] {
            assert_eq!(play(&basis, threads), alone);
        }
    }

    #[test]
    fn a_refusal_stays_with_its_instance() {
        let (package, other) = (Package::small(1), Package::small(2));
        let (basis, foreign) = (open(&package), open(&other));
        let (mut own, mut wrong) = (memory_for(&basis), memory_for(&foreign));
        let mut weights = [[0.0; Package::COMPONENTS]; 2];
        let [one, two] = &mut weights;
        let mut positions = vec![[9.0; 3]; 2 * basis.vertex_count()];
        let (first, second) = positions.split_at_mut(basis.vertex_count());
        let instance = |weights, workspace, positions| Instance {
            basis: &basis,
            controls: Controls::new(&basis, weights).unwrap(),
            workspace,
            positions,
            normals: None,
            outcome: None,
        };
        let mut instances = [
            instance(one, Workspace::new(&foreign, &mut wrong).unwrap(), first),
            instance(two, Workspace::new(&basis, &mut own).unwrap(), second),
        ];
        assert_eq!(Batch::new(&mut instances).play(), 2);
        assert_eq!(instances[0].outcome, Some(Err(FrameError::ForeignWorkspace)));
        assert_eq!(instances[1].outcome, Some(Ok(FrameOutcome::Unchanged)));
        assert!(positions[..basis.vertex_count()].iter().all(|p| *p == [9.0; 3]));
    }

    #[test]
    fn what_threads_may_share_and_send() {
        fn shared<T: Sync>() {}
        fn sent<T: Send>() {}
        shared::<Basis<'static>>();
        shared::<Batch<'static, Instance<'static>>>();
        shared::<Batch<'static, core::cell::Cell<u8>>>();
        sent::<Instance<'static>>();
        sent::<Workspace<'static>>();
        sent::<crate::Handles<'static>>();
        sent::<Batch<'static, Instance<'static>>>();
    }
}
