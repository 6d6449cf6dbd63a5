//! A host in few lines: what a C program does, from Rust, through the exported functions alone.

use core::ffi::c_void;
use core::mem::MaybeUninit;
use core::ptr::null_mut;

use sinew::*;

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

    pub fn pointer(&mut self) -> *mut c_void {
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
    pub info: SinewBasisInfo,
}

impl Player {
    /// Opens and creates, for the exact tier.
    pub fn new(package: &[u8]) -> Result<Self, SinewStatus> {
        Self::of_tier(package, SinewTier::Exact)
    }

    /// The same for a tier that the package has.
    pub fn of_tier(package: &[u8], tier: SinewTier) -> Result<Self, SinewStatus> {
        let mut options = SinewWorkspaceOptions {
            struct_bytes: size_of::<SinewWorkspaceOptions>(),
            tier: tier as i32,
            kernels: SinewKernels::Widest as i32,
        };
        // SAFETY: every pointer is to memory that lives as long as the player, of the lengths that the layouts say.
        unsafe {
            let mut basis_memory = Memory::new(layout_bytes(|layout| sinew_basis_layout(layout)));
            let (mut basis, mut workspace, mut controls) = (null_mut(), null_mut(), null_mut());
            let status = sinew_basis_open(
                SINEW_ABI_VERSION,
                package.as_ptr().cast(),
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
            if info.has_exact_tier == 0 {
                // All that a mutant may have left.
                options.tier = SinewTier::Bones as i32;
            }
            let bytes = layout_bytes(|layout| sinew_workspace_layout(basis, &options, layout));
            let mut workspace_memory = Memory::new(bytes);
            let (memory, bytes) = (workspace_memory.pointer(), workspace_memory.bytes());
            let status = sinew_workspace_create(basis, &options, memory, bytes, &mut workspace, null_mut());
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
                info,
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

    /// What a batch gets of this player.
    pub fn instance(&mut self) -> SinewInstance {
        SinewInstance {
            workspace: self.workspace,
            controls: self.controls,
            positions: self.positions.as_mut_ptr(),
            position_floats: self.positions.len(),
            normals: self.normals.as_mut_ptr(),
            normal_floats: self.normals.len(),
        }
    }

    /// Memory of basis, workspace and controls.
    pub fn memory(&mut self) -> &mut [Memory; 3] {
        &mut self.memory
    }
}

/// A player in one block, with bytes behind it that are nobody's.
pub struct Block {
    memory: Memory,
    tail_bytes: usize,
    pub player: SinewPlayer,
}

impl Block {
    pub fn new(package: &[u8], tier: SinewTier, tail_bytes: usize) -> Result<Self, SinewStatus> {
        let options = SinewWorkspaceOptions {
            struct_bytes: size_of::<SinewWorkspaceOptions>(),
            tier: tier as i32,
            kernels: SinewKernels::Widest as i32,
        };
        let (bytes, length) = (package.as_ptr().cast(), package.len());
        let mut layout = SinewLayout {
            size_bytes: 0,
            alignment: 64,
        };
        let mut player = sized::<SinewPlayer>();
        // SAFETY: every pointer is to memory that lives as long as the block, of the lengths that the layout says; the player
        // is whole once it is open.
        unsafe {
            match sinew_player_layout(bytes, length, &options, &mut layout, null_mut()) {
                SinewStatus::Ok => {}
                refused => return Err(refused),
            }
            let mut memory = Memory::new(layout.size_bytes + tail_bytes);
            let (at, room, out) = (memory.pointer(), memory.bytes(), player.as_mut_ptr());
            let status = sinew_player_open(SINEW_ABI_VERSION, bytes, length, &options, at, room, out, null_mut());
            assert_eq!(status, SinewStatus::Ok);
            Ok(Self {
                memory,
                tail_bytes,
                player: player.assume_init(),
            })
        }
    }

    /// The bytes behind it, as they were.
    pub fn tail(&self) -> &[u8] {
        let bytes = self.memory.lines.as_ptr().cast::<u8>();
        // SAFETY: the memory is that long.
        unsafe { core::slice::from_raw_parts(bytes.add(self.memory.bytes() - self.tail_bytes), self.tail_bytes) }
    }
}

/// Pins of a player's basis.
pub struct Pins {
    _memory: Memory,
    pub pins: *mut SinewPins,
}

impl Pins {
    pub fn new(player: &Player, capacity: u32) -> Self {
        let mut pins = null_mut();
        // SAFETY: the memory is as long as the layout says and lives as long as this.
        unsafe {
            let bytes = layout_bytes(|layout| sinew_pins_layout(player.basis, capacity, layout));
            let mut memory = Memory::new(bytes);
            let (at, room) = (memory.pointer(), memory.bytes());
            let status = sinew_pins_create(player.basis, capacity, at, room, &mut pins, null_mut());
            assert_eq!(status, SinewStatus::Ok);
            Self { _memory: memory, pins }
        }
    }

    pub fn add(&self, player: &Player, vertex: u32) -> SinewStatus {
        // SAFETY: the player's memory stands.
        unsafe { sinew_pins_add(player.basis, self.pins, player.workspace, vertex, null_mut()) }
    }

    pub fn aim(&self, vertex: u32, target: [f32; 3]) -> SinewStatus {
        // SAFETY: this memory stands.
        unsafe { sinew_pins_move(self.pins, vertex, target.as_ptr()) }
    }

    pub fn drag(&self, player: &Player) -> Result<SinewDragReport, SinewStatus> {
        let mut report = sized::<SinewDragReport>();
        // SAFETY: the player's memory stands; the report is whole after a drag.
        unsafe {
            let (pins, out) = (self.pins, report.as_mut_ptr());
            match sinew_pins_drag(player.basis, pins, player.workspace, player.controls, out, null_mut()) {
                SinewStatus::Ok => Ok(report.assume_init()),
                refused => Err(refused),
            }
        }
    }
}

/// A vertex buffer of everything there is, interleaved, and its scratch.
pub struct Vertices {
    pub bytes: Vec<u8>,
    scratch: Vec<f32>,
}

impl Vertices {
    pub const STRIDE: usize = 48;

    pub fn new(player: &Player) -> Self {
        let count = player.info.render_vertex_count as usize;
        Self {
            bytes: vec![0; Self::STRIDE * count],
            scratch: vec![0.0; 4 * count],
        }
    }

    /// Writes the player's last frame.
    pub fn write(&mut self, player: &Player) -> Result<SinewBounds, SinewStatus> {
        let textured = |stride| if player.info.has_texture == 1 { stride } else { 0 };
        let options = SinewVertexOptions {
            struct_bytes: size_of::<SinewVertexOptions>(),
            positions: player.positions.as_ptr(),
            position_floats: player.positions.len(),
            normals: player.normals.as_ptr(),
            normal_floats: player.normals.len(),
            bytes: self.bytes.as_mut_ptr().cast(),
            byte_count: self.bytes.len(),
            scratch: self.scratch.as_mut_ptr(),
            scratch_floats: self.scratch.len(),
            position_offset: 0,
            position_stride: Self::STRIDE,
            normal_offset: 12,
            normal_stride: Self::STRIDE,
            tangent_offset: 24,
            tangent_stride: textured(Self::STRIDE),
            texture_offset: 40,
            texture_stride: textured(Self::STRIDE),
            encoding: SinewUnitEncoding::Float32 as i32,
        };
        let mut bounds = SinewBounds {
            minimum: [f32::NAN; 3],
            maximum: [f32::NAN; 3],
        };
        // SAFETY: all memory stands.
        match unsafe { sinew_vertices_write(player.basis, &options, &mut bounds, null_mut()) } {
            SinewStatus::Ok => Ok(bounds),
            refused => Err(refused),
        }
    }
}

/// A batch and its memory.
pub struct Round {
    _memory: Memory,
    pub batch: *mut SinewBatch,
}

impl Round {
    pub fn new(basis: *const SinewBasis, instances: &[SinewInstance]) -> Self {
        let mut batch = null_mut();
        // SAFETY: the memory is as long as the layout says and lives as long as this.
        unsafe {
            let mut memory = Memory::new(layout_bytes(|layout| sinew_batch_layout(instances.len(), layout)));
            let (first, count, size) = (instances.as_ptr(), instances.len(), size_of::<SinewInstance>());
            let (at, room) = (memory.pointer(), memory.bytes());
            let status = sinew_batch_create(basis, first, count, size, at, room, &mut batch, null_mut());
            assert_eq!(status, SinewStatus::Ok);
            Self { _memory: memory, batch }
        }
    }

    pub fn play(&self, basis: *const SinewBasis) -> usize {
        let mut played = usize::MAX;
        // SAFETY: this memory and that of the instances stand.
        let status = unsafe { sinew_batch_play(basis, self.batch, &mut played, null_mut()) };
        assert_eq!(status, SinewStatus::Ok);
        played
    }

    pub fn begin(&self) {
        // SAFETY: this memory stands.
        assert_eq!(unsafe { sinew_batch_begin(self.batch) }, SinewStatus::Ok);
    }

    pub fn report(&self, instance: usize) -> SinewInstanceReport {
        let mut report = sized::<SinewInstanceReport>();
        // SAFETY: this memory stands; the report is whole once written.
        unsafe {
            let status = sinew_batch_report(self.batch, instance, report.as_mut_ptr());
            assert_eq!(status, SinewStatus::Ok);
            report.assume_init()
        }
    }
}
