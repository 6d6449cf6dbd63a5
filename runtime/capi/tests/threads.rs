//! Threads: one basis serves all of them with the same bits; a handle used by two at once is refused, not corrupted.

mod common;

use std::thread;

use common::package;
use common::player::Player;
use sinew::*;

/// Pointers that another thread may use: the library's rules for threads are what is tested.
struct Shared<T>(*mut T);

impl<T> Clone for Shared<T> {
    fn clone(&self) -> Self {
        Self(self.0)
    }
}

// SAFETY: every function of the library refuses what it may not do at that moment.
unsafe impl<T> Send for Shared<T> {}

impl<T> Shared<T> {
    fn get(&self) -> *mut T {
        self.0
    }
}

/// Sets the control of a frame's number, plays, and adds up the bits.
fn play(player: &mut Player, frame_count: u32) -> u64 {
    (0..frame_count).fold(0, |checksum, frame| {
        let weight = (frame as f32 * 0.3).sin();
        // SAFETY: the player's memory stands.
        let status = unsafe {
            sinew_control_set(
                player.controls,
                frame % player.control_count,
                weight,
                core::ptr::null_mut(),
            )
        };
        assert_eq!(status, SinewStatus::Ok);
        player.frame().expect("finite");
        let bits = player
            .positions
            .iter()
            .chain(&player.normals)
            .map(|x| u64::from(x.to_bits()));
        bits.fold(checksum, |sum, bits| {
            sum.rotate_left(5) ^ bits.wrapping_mul(0x9e37_79b9_7f4a_7c15)
        })
    })
}

#[test]
fn one_basis_serves_many_threads_with_the_same_bits() {
    let bytes = package();
    let alone = play(&mut Player::new(&bytes).expect("valid"), 200);
    let owner = Player::new(&bytes).expect("valid");
    let basis = Shared(owner.basis);
    thread::scope(|scope| {
        let threads: Vec<_> = (0..4)
            .map(|_| {
                let (basis, bytes) = (basis.clone(), &bytes);
                scope.spawn(move || {
                    let mut player = Player::new(bytes).expect("valid");
                    player.basis = basis.get();
                    play(&mut player, 200)
                })
            })
            .collect();
        for thread in threads {
            assert_eq!(thread.join().expect("no panic"), alone);
        }
    });
    drop(owner);
}

#[test]
fn a_workspace_used_by_two_threads_at_once_is_refused_and_stays_whole() {
    let bytes = package();
    let mut owner = Player::new(&bytes).expect("valid");
    let handles = (Shared(owner.basis), Shared(owner.workspace), Shared(owner.controls));
    thread::scope(|scope| {
        for _ in 0..4 {
            let (basis, workspace, controls) = handles.clone();
            let bytes = &bytes;
            scope.spawn(move || {
                let mut player = Player::new(bytes).expect("valid");
                (player.basis, player.workspace) = (basis.get(), workspace.get());
                player.controls = controls.get();
                for frame in 0..300 {
                    let weight = (frame as f32 * 0.3).sin();
                    // SAFETY: the owner's memory stands.
                    let set = unsafe { sinew_control_set(player.controls, 0, weight, core::ptr::null_mut()) };
                    assert!(matches!(set, SinewStatus::Ok | SinewStatus::InUse), "{set:?}");
                    let played = player.frame();
                    assert!(matches!(played, Ok(_) | Err(SinewStatus::InUse)), "{played:?}");
                    if played.is_ok() {
                        assert!(player.positions.iter().all(|x| x.is_finite()));
                    }
                }
            });
        }
    });
    // Back to a known pose: the same as one that was alone all the time.
    for player in [&mut owner, &mut Player::new(&bytes).expect("valid")] {
        // SAFETY: the players' memory stands.
        assert_eq!(unsafe { sinew_controls_reset(player.controls) }, SinewStatus::Ok);
        player.frame().expect("finite");
    }
    let alone = play(&mut Player::new(&bytes).expect("valid"), 20);
    assert_eq!(play(&mut owner, 20), alone);
}
