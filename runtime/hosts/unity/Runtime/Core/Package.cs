using System;
using System.Collections.Generic;

namespace Sinew
{
    /// A component that a weight moves.
    public sealed class Control
    {
        /// Unique in its package.
        public string Name { get; internal set; }
        /// The least weight seen in training, at most 0.
        public float Minimum { get; internal set; }
        /// The greatest weight seen in training, at least 0.
        public float Maximum { get; internal set; }
        /// Index of the control above it; -1 for a coarse one.
        public int Parent { get; internal set; }
        /// 0 for coarse ones, 1 for their children and so on.
        public int Level { get; internal set; }
    }

    /// An opened package, shared by any number of players and threads. Copies the bytes that it is made of. Disposing of it
    /// while players live is allowed: its memory goes with the last of them.
    public sealed unsafe class Package : IDisposable
    {
        readonly Block bytes;
        readonly Dictionary<string, int> indices;

        internal Block Block { get; }
        internal IntPtr Basis { get; }

        /// V: vertices of the source, in its order.
        public int VertexCount { get; }
        /// R: vertices that are drawn, split where texture coordinates are.
        public int RenderVertexCount { get; }
        /// F: triangles.
        public int FaceCount { get; }
        public bool HasTexture { get; }
        public bool HasExactTier { get; }
        public bool HasBones { get; }
        /// One for each weight, in their order.
        public IReadOnlyList<Control> Controls { get; }

        /// Takes some milliseconds for some ten thousand vertices: every check is made here.
        ///
        /// Throws `SinewException` where the bytes are no package that this library plays, or the library is of another
        /// interface; `ArgumentNullException`.
        public Package(byte[] package)
        {
            if (package == null)
            {
                throw new ArgumentNullException(nameof(package));
            }
            bytes = new Block(package.Length, 64, null);
            System.Runtime.InteropServices.Marshal.Copy(package, 0, (IntPtr)bytes.Pointer, package.Length);
            var opened = false;
            try
            {
                Native.Layout layout;
                Native.Check(Native.sinew_basis_layout(&layout));
                Block = Block.ForHandle(layout, bytes);
                IntPtr basis;
                var details = Native.NewDetails();
                Native.Check(Native.sinew_basis_open(Native.AbiVersion, bytes.Pointer, Native.Size(bytes.Bytes), Block.Pointer, Native.Size(Block.Bytes), &basis, &details), &details);
                Basis = basis;
                var info = new Native.BasisInfo { StructBytes = Native.Size(sizeof(Native.BasisInfo)) };
                Native.Check(Native.sinew_basis_info(basis, &info));
                VertexCount = (int)info.VertexCount;
                RenderVertexCount = (int)info.RenderVertexCount;
                FaceCount = (int)info.FaceCount;
                HasTexture = info.HasTexture != 0;
                HasExactTier = info.HasExactTier != 0;
                HasBones = info.BoneCount != 0;
                var controls = new Control[info.ControlCount];
                indices = new Dictionary<string, int>(controls.Length);
                for (var k = 0; k < controls.Length; k++)
                {
                    controls[k] = ReadControl(basis, (uint)k);
                    indices.Add(controls[k].Name, k);
                }
                Controls = Array.AsReadOnly(controls);
                opened = true;
            }
            finally
            {
                if (!opened)
                {
                    Dispose();
                }
            }
        }

        static Control ReadControl(IntPtr basis, uint k)
        {
            var name = stackalloc byte[Native.NameBytes];
            float minimum, maximum;
            uint parent, level;
            Native.Check(Native.sinew_control_name(basis, k, name, Native.Size(Native.NameBytes)));
            Native.Check(Native.sinew_control_range(basis, k, &minimum, &maximum));
            Native.Check(Native.sinew_control_parent(basis, k, &parent, &level));
            return new Control
            {
                Name = Native.Text(name, Native.NameBytes),
                Minimum = minimum,
                Maximum = maximum,
                Parent = parent == Native.None ? -1 : (int)parent,
                Level = (int)level,
            };
        }

        /// The version of the library that is loaded.
        public static string LibraryVersion => System.Runtime.InteropServices.Marshal.PtrToStringAnsi(Native.sinew_version());

        /// Index of the control of this name. Throws `ArgumentException` where there is none.
        public int IndexOf(string name)
        {
            int index;
            if (name == null || !indices.TryGetValue(name, out index))
            {
                throw new ArgumentException("the package has no control \"" + name + "\"", nameof(name));
            }
            return index;
        }

        /// Triangles of render vertices: three indices each, counter-clockwise from outside in the source's right-handed axes.
        ///
        /// `clockwise`: the other way round.
        public int[] Faces(bool clockwise = false)
        {
            var held = false;
            try
            {
                held = Block.Enter();
                var faces = new int[3 * FaceCount];
                fixed (int* first = faces)
                {
                    Native.Check(Native.sinew_basis_render_faces(Basis, clockwise ? 1 : 0, (uint*)first, Native.Size(faces.Length)));
                }
                return faces;
            }
            finally
            {
                Block.Leave(held);
            }
        }

        public void Dispose()
        {
            Block?.Dispose();
            bytes.Dispose();
        }
    }
}
