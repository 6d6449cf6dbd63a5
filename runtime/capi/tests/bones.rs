//! Bones through the C functions, beside the runtime's own.

mod common;

use core::ptr::null_mut;

use common::package;
use common::player::Player;
use sinew::*;
use sinew_runtime::{
    Basis, BoneMaps, BoneOutput, BoneTransform, Controls, Kernels, TierChoice, Workspace, WorkspaceLayout,
};

fn weight(control: u32) -> f32 {
    0.7 - 0.4 * control as f32
}

#[test]
fn bones_are_the_runtime_s() {
    let package = package();
    let player = Player::of_tier(&package, SinewTier::Bones).expect("valid");
    for control in 0..player.control_count {
        // SAFETY: the player's memory stands.
        let status = unsafe { sinew_control_set(player.controls, control, weight(control), null_mut()) };
        assert_eq!(status, SinewStatus::Ok);
    }
    let basis = Basis::open(&package).expect("valid");
    let info = basis.bones().expect("bones");
    let (count, vertices) = (info.count(), basis.vertex_count());
    assert_eq!((player.info.bone_count, player.info.bone_influences), (count as u32, 4));

    let layout = WorkspaceLayout::for_tier(&basis, TierChoice::Bones).expect("it has some");
    let mut memory = vec![0; layout.unaligned_bytes()];
    let made = Workspace::for_tier(&basis, TierChoice::Bones, &mut memory, Kernels::detect());
    let mut workspace = made.expect("enough");
    let mut weights = vec![0.0; basis.component_count()];
    let mut controls = Controls::new(&basis, &mut weights).expect("one weight a component");
    for k in 0..basis.component_count() {
        controls.set(k, weight(k as u32)).expect("finite");
    }
    let mut own = vec![[0.0; 12]; count];
    let mut joints = vec![BoneTransform::default(); count];
    for maps in [BoneOutput::Rows(&mut own), BoneOutput::Scaled(&mut joints)] {
        let (basis, controls) = (&basis, &controls);
        BoneMaps { basis, controls, maps }.run(&mut workspace).expect("finite");
    }
    let mut found = vec![7.0; 12 * count + 5];
    let form = |form: SinewBoneForm, found: &mut [f32]| {
        // SAFETY: handles and memory stand.
        unsafe {
            let (basis, workspace, controls) = (player.basis, player.workspace, player.controls);
            let room = found.len();
            sinew_bones_pose(
                basis,
                workspace,
                controls,
                form as i32,
                found.as_mut_ptr(),
                room,
                null_mut(),
            )
        }
    };
    assert_eq!(form(SinewBoneForm::Rows, &mut found), SinewStatus::Ok);
    assert_eq!(&found[..12 * count], own.as_flattened());
    assert_eq!(found[12 * count..], [7.0; 5], "more stays untouched");
    assert_eq!(form(SinewBoneForm::Columns, &mut found), SinewStatus::Ok);
    assert_eq!((found[1], found[9]), (own[0][4], own[0][3]));
    assert_eq!(form(SinewBoneForm::Scaled, &mut found), SinewStatus::Ok);
    assert_eq!(found[..3], joints[0].translation);
    assert_eq!(found[10 * count - 3..10 * count], joints[count - 1].scale);

    let (mut bones, mut shares) = (vec![9; 4 * vertices], vec![9; 4 * vertices]);
    let (mut own_bones, mut own_shares) = (vec![0; 4 * vertices], vec![0; 4 * vertices]);
    info.write_skin(&mut own_bones, &mut own_shares);
    // SAFETY: memory stands.
    let statuses = unsafe {
        let (to_bones, to_shares) = (bones.as_mut_ptr(), shares.as_mut_ptr());
        let skin = sinew_bones_skin(player.basis, to_bones, bones.len(), to_shares, shares.len(), null_mut());
        let rest = sinew_bones_rest(player.basis, found.as_mut_ptr(), 10 * count, null_mut());
        [skin, rest]
    };
    assert_eq!(statuses, [SinewStatus::Ok; 2]);
    assert_eq!((bones, shares), (own_bones, own_shares));
    assert_eq!(found[..3], info.rest_transform(0).translation);
    assert_eq!(found[3..7], info.rest_transform(0).rotation);
}
