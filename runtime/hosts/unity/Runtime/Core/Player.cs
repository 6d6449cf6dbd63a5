using System;
using System.Runtime.InteropServices;

namespace Sinew
{
    /// What a player plays.
    public enum Tier
    {
        /// All vertices are solved for: what was trained.
        Exact = 0,
        /// A few bones that the vertices follow: for crowds.
        Bones = 1,
    }

    /// A box around positions, in the source's units.
    [StructLayout(LayoutKind.Sequential)]
    public struct Bounds
    {
        public float MinimumX, MinimumY, MinimumZ;
        public float MaximumX, MaximumY, MaximumZ;
    }

    /// Where attributes of render vertices lie in a buffer: first byte and bytes from one vertex to the next. A stride of 0
    /// leaves an attribute out. All are floats: 3 of a position, 3 of a normal, 4 of a tangent, 2 of texture coordinates.
    public struct VertexLayout
    {
        public int PositionOffset, PositionStride;
        public int NormalOffset, NormalStride;
        public int TangentOffset, TangentStride;
        public int TextureOffset, TextureStride;
    }

    /// One mesh that is posed on its own: weights in, vertices out. No call here allocates on the managed heap unless it throws.
    /// One thread at a time: a second one gets an exception with `SinewStatus.InUse`. Disposing is safe at any moment.
    public sealed unsafe class Player : IDisposable
    {
        readonly Block workspaceBlock;
        readonly Block controlsBlock;
        readonly IntPtr controls;

        internal IntPtr Workspace { get; }
        internal IntPtr Weights => controls;
        /// Refers to all that the player lies in.
        internal Block Block => controlsBlock;

        public Package Package { get; }
        public Tier Tier { get; }

        /// All weights are 0: the rest shape. Throws `SinewException` where the package lacks the tier.
        public Player(Package package, Tier tier = Tier.Exact)
        {
            if (package == null)
            {
                throw new ArgumentNullException(nameof(package));
            }
            Package = package;
            Tier = tier;
            var held = false;
            var opened = false;
            try
            {
                held = package.Block.Enter();
                var basis = package.Basis;
                var options = new Native.WorkspaceOptions { StructBytes = Native.Size(sizeof(Native.WorkspaceOptions)), Tier = (int)tier };
                Native.Layout layout;
                Native.Check(Native.sinew_workspace_layout(basis, &options, &layout));
                workspaceBlock = Block.ForHandle(layout, package.Block);
                Native.Check(Native.sinew_controls_layout(basis, &layout));
                controlsBlock = Block.ForHandle(layout, workspaceBlock);
                IntPtr made;
                var details = Native.NewDetails();
                Native.Check(Native.sinew_workspace_create(basis, &options, workspaceBlock.Pointer, Native.Size(workspaceBlock.Bytes), &made, &details), &details);
                Workspace = made;
                Native.Check(Native.sinew_controls_create(basis, controlsBlock.Pointer, Native.Size(controlsBlock.Bytes), &made, &details), &details);
                controls = made;
                opened = true;
            }
            finally
            {
                if (!opened)
                {
                    Dispose();
                }
                package.Block.Leave(held);
            }
        }

        internal bool Enter() => controlsBlock.Enter();

        internal void Leave(bool held) => controlsBlock.Leave(held);

        /// A weight. Setting clamps to the control's range, and throws `SinewException` where it is NaN or infinite;
        /// `ArgumentOutOfRangeException` where there is no such control.
        public float this[int control]
        {
            get
            {
                CheckControl(control);
                var held = Enter();
                try
                {
                    float weight;
                    Native.Check(Native.sinew_control_get(controls, (uint)control, &weight));
                    return weight;
                }
                finally
                {
                    Leave(held);
                }
            }
            set
            {
                CheckControl(control);
                var held = Enter();
                try
                {
                    Native.Check(Native.sinew_control_set(controls, (uint)control, value, null));
                }
                finally
                {
                    Leave(held);
                }
            }
        }

        /// The same by name: looks it up in a dictionary.
        public float this[string control]
        {
            get => this[Package.IndexOf(control)];
            set => this[Package.IndexOf(control)] = value;
        }

        /// Sets a weight beyond its range, where a pose may leave what was seen in training.
        public void SetUnclamped(int control, float weight)
        {
            CheckControl(control);
            var held = Enter();
            try
            {
                Native.Check(Native.sinew_control_set_unclamped(controls, (uint)control, weight));
            }
            finally
            {
                Leave(held);
            }
        }

        /// Sets all weights, each clamped to its range. Throws, and sets none, where one is NaN or infinite.
        public void SetAll(float[] weights)
        {
            CheckLength(weights, Package.Controls.Count, nameof(weights));
            var held = Enter();
            try
            {
                var details = Native.NewDetails();
                fixed (float* first = weights)
                {
                    Native.Check(Native.sinew_controls_set_all(controls, first, Native.Size(weights.Length), &details), &details);
                }
            }
            finally
            {
                Leave(held);
            }
        }

        /// Takes all weights.
        public void GetAll(float[] weights)
        {
            CheckLength(weights, Package.Controls.Count, nameof(weights));
            var held = Enter();
            try
            {
                fixed (float* first = weights)
                {
                    Native.Check(Native.sinew_controls_get_all(controls, first, Native.Size(weights.Length)));
                }
            }
            finally
            {
                Leave(held);
            }
        }

        /// All weights to 0.
        public void Reset()
        {
            var held = Enter();
            try
            {
                Native.Check(Native.sinew_controls_reset(controls));
            }
            finally
            {
                Leave(held);
            }
        }

        /// Takes the weights of another player's controls of the same names, clamped to the ranges here: for a package that
        /// takes the place of an older one. Returns how many have a namesake.
        public int CarryFrom(Player other)
        {
            if (other == null)
            {
                throw new ArgumentNullException(nameof(other));
            }
            var held = Enter();
            var otherHeld = false;
            try
            {
                otherHeld = other.Enter();
                uint carried;
                Native.Check(Native.sinew_controls_carry(other.Package.Basis, other.controls, Package.Basis, controls, &carried));
                return (int)carried;
            }
            finally
            {
                other.Leave(otherHeld);
                Leave(held);
            }
        }

        /// Plays a frame into memory of the caller's, such as a NativeArray's.
        ///
        /// `positions`: takes xyz for each of V vertices, source order; not null. `normals`: the same of unit normals, or null.
        /// The counts say for how many floats there is room: at least 3 V.
        ///
        /// Throws `SinewException`: `FrameOverflow` (the outputs are the rest shape), `InUse`, `TooShort`.
        public Bounds Frame(float* positions, int positionFloats, float* normals, int normalFloats)
        {
            var held = Enter();
            try
            {
                var options = new Native.FrameOptions
                {
                    StructBytes = Native.Size(sizeof(Native.FrameOptions)),
                    Positions = positions,
                    PositionFloats = Native.Size(positionFloats),
                    Normals = normals,
                    NormalFloats = Native.Size(normalFloats),
                };
                var report = new Native.FrameReport { StructBytes = Native.Size(sizeof(Native.FrameReport)) };
                var details = Native.NewDetails();
                Native.Check(Native.sinew_frame(Package.Basis, Workspace, controls, &options, &report, &details), &details);
                return report.Bounds;
            }
            finally
            {
                Leave(held);
            }
        }

        /// The same into arrays of at least 3 V floats; `normals` may be null.
        public Bounds Frame(float[] positions, float[] normals = null)
        {
            if (positions == null)
            {
                throw new ArgumentNullException(nameof(positions));
            }
            fixed (float* x = positions)
            fixed (float* n = normals)
            {
                return Frame(x, positions.Length, n, normals == null ? 0 : normals.Length);
            }
        }

        /// Writes the R render vertices of a frame into a vertex buffer.
        ///
        /// `positions`, `normals`: of `Frame`; normals may be null where neither normals nor tangents are asked for.
        /// `scratch`: 4 R floats for tangents; null where none are written.
        public Bounds WriteVertices(VertexLayout layout, float* positions, float* normals, float* scratch, void* bytes, long byteCount)
        {
            var held = Enter();
            try
            {
                var floats = Native.Size(3L * Package.VertexCount);
                var options = new Native.VertexOptions
                {
                    StructBytes = Native.Size(sizeof(Native.VertexOptions)),
                    Positions = positions,
                    PositionFloats = floats,
                    Normals = normals,
                    NormalFloats = normals == null ? UIntPtr.Zero : floats,
                    Bytes = bytes,
                    ByteCount = Native.Size(byteCount),
                    Scratch = scratch,
                    ScratchFloats = scratch == null ? UIntPtr.Zero : Native.Size(4L * Package.RenderVertexCount),
                    PositionOffset = Native.Size(layout.PositionOffset),
                    PositionStride = Native.Size(layout.PositionStride),
                    NormalOffset = Native.Size(layout.NormalOffset),
                    NormalStride = Native.Size(layout.NormalStride),
                    TangentOffset = Native.Size(layout.TangentOffset),
                    TangentStride = Native.Size(layout.TangentStride),
                    TextureOffset = Native.Size(layout.TextureOffset),
                    TextureStride = Native.Size(layout.TextureStride),
                };
                Bounds bounds;
                var details = Native.NewDetails();
                Native.Check(Native.sinew_vertices_write(Package.Basis, &options, &bounds, &details), &details);
                return bounds;
            }
            finally
            {
                Leave(held);
            }
        }

        void CheckControl(int control)
        {
            if (control < 0 || control >= Package.Controls.Count)
            {
                throw new ArgumentOutOfRangeException(nameof(control), control, "the package has " + Package.Controls.Count + " controls");
            }
        }

        static void CheckLength(float[] array, int length, string name)
        {
            if (array == null)
            {
                throw new ArgumentNullException(name);
            }
            if (array.Length != length)
            {
                throw new ArgumentException("needs " + length + " numbers, one a control, and has " + array.Length, name);
            }
        }

        public void Dispose()
        {
            controlsBlock?.Dispose();
            workspaceBlock?.Dispose();
        }
    }
}
