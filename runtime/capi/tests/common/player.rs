//! A host in few lines: what a C program does, from Rust, through the exported functions alone.

use core::mem::MaybeUninit;
use core::ptr::null_mut;

use sinew::{
    SINEW_ABI_VERSION, SinewBasis, SinewBasisInfo, SinewControls, SinewDetails, SinewFrameOptions, SinewFrameOutcome,
    SinewFrameReport, SinewLayout, SinewStatus, SinewWorkspace, sinew_basis_info, sinew_basis_layout, sinew_basis_open,
    sinew_controls_create, sinew_controls_layout, sinew_frame, sinew_workspace_create, sinew_workspace_layout,
};

/// A growing struct with its size set and the rest zero; to be read only once the library has written it.
pub fn sized<T>() -> MaybeUninit<T> {
    let mut value = MaybeUninit::<T>::zeroed();
    // SAFETY: the size is the first member of every growing struct.
    unsafe { value.as_mut_ptr().cast::<usize>().write(size_of::<T>()) };
    value
}

/// Memory at a multiple of 64 bytes.
pub struct Memory {
    lines: Vec<Line>,
}

#[derive(Clone, Copy)]
#[repr(C, align(64))]
struct Line([u8; 64]);

impl Memory {
    pub fn new(byte_count: usize) -> Self {
        Self {
            lines: vec![Line([0xaa; 64]); byte_count.div_ceil(64)],
        }
    }

    pub fn pointer(&mut self) -> *mut u8 {
        self.lines.as_mut_ptr().cast()
    }

    pub fn bytes(&self) -> usize {
        64 * self.lines.len()
    }
}

/// The size of a handle, asked for by one of the layout functions.
pub fn layout_bytes(ask: impl FnOnce(*mut SinewLayout) -> SinewStatus) -> usize {
    let mut layout = SinewLayout {
        size_bytes: 0,
        alignment: 0,
    };
    assert_eq!(ask(&mut layout), SinewStatus::Ok);
    assert_eq!(layout.alignment, 64);
    layout.size_bytes
}

/// All memory of one host, made before the first call.
pub struct Player {
    memory: [Memory; 3],
    pub basis: *mut SinewBasis,
    pub workspace: *mut SinewWorkspace,
    pub controls: *mut SinewControls,
    pub positions: Vec<f32>,
    pub normals: Vec<f32>,
    pub control_count: u32,
}

impl Player {
    /// Opens and creates.
    pub fn new(package: &[u8]) -> Result<Self, SinewStatus> {
        // SAFETY: every pointer is to memory that lives as long as the player, of the lengths that the layouts say.
        unsafe {
            let mut basis_memory = Memory::new(layout_bytes(|layout| sinew_basis_layout(layout)));
            let (mut basis, mut workspace, mut controls) = (null_mut(), null_mut(), null_mut());
            let status = sinew_basis_open(
                SINEW_ABI_VERSION,
                package.as_ptr(),
                package.len(),
                basis_memory.pointer(),
                basis_memory.bytes(),
                &mut basis,
                null_mut(),
            );
            if status != SinewStatus::Ok {
                return Err(status);
            }
            let mut info = sized::<SinewBasisInfo>();
            assert_eq!(sinew_basis_info(basis, info.as_mut_ptr()), SinewStatus::Ok);
            let info = info.assume_init();
            let mut workspace_memory = Memory::new(layout_bytes(|layout| sinew_workspace_layout(basis, layout)));
            let (memory, bytes) = (workspace_memory.pointer(), workspace_memory.bytes());
            let status = sinew_workspace_create(basis, memory, bytes, &mut workspace, null_mut());
            assert_eq!(status, SinewStatus::Ok);
            let mut controls_memory = Memory::new(layout_bytes(|layout| sinew_controls_layout(basis, layout)));
            let (memory, bytes) = (controls_memory.pointer(), controls_memory.bytes());
            let status = sinew_controls_create(basis, memory, bytes, &mut controls, null_mut());
            assert_eq!(status, SinewStatus::Ok);
            let floats = 3 * info.vertex_count as usize;
            Ok(Self {
                memory: [basis_memory, workspace_memory, controls_memory],
                basis,
                workspace,
                controls,
                positions: vec![f32::NAN; floats],
                normals: vec![f32::NAN; floats],
                control_count: info.control_count,
            })
        }
    }

    pub fn options(&mut self) -> SinewFrameOptions {
        SinewFrameOptions {
            struct_bytes: size_of::<SinewFrameOptions>(),
            positions: self.positions.as_mut_ptr(),
            position_floats: self.positions.len(),
            normals: self.normals.as_mut_ptr(),
            normal_floats: self.normals.len(),
        }
    }

    pub fn frame(&mut self) -> Result<SinewFrameOutcome, SinewStatus> {
        let options = self.options();
        let (mut report, mut details) = (sized::<SinewFrameReport>(), sized::<SinewDetails>());
        // SAFETY: as in `new`; the report is whole after a frame.
        unsafe {
            let (report_out, details_out) = (report.as_mut_ptr(), details.as_mut_ptr());
            let status = sinew_frame(
                self.basis,
                self.workspace,
                self.controls,
                &options,
                report_out,
                details_out,
            );
            match status {
                SinewStatus::Ok => Ok(report.assume_init().outcome),
                refused => Err(refused),
            }
        }
    }

    /// Memory of basis, workspace and controls.
    pub fn memory(&mut self) -> &mut [Memory; 3] {
        &mut self.memory
    }
}
