// The C interface (sinew.h and sinew_pins.h), member by member. Everything else in this folder goes through here.

using System;
using System.Runtime.InteropServices;

namespace Sinew
{
    internal static unsafe class Native
    {
        /// Of the headers that the structs below were written from.
        internal const uint AbiVersion = 1;
        internal const uint None = uint.MaxValue;
        internal const int NameBytes = 65;
        internal const int TextBytes = 216;

#if UNITY_IOS && !UNITY_EDITOR
        const string Library = "__Internal";
#else
        const string Library = "sinew";
#endif

        [StructLayout(LayoutKind.Sequential)]
        internal struct Layout
        {
            public UIntPtr SizeBytes;
            public UIntPtr Alignment;
        }

        [StructLayout(LayoutKind.Sequential)]
        internal struct Details
        {
            public UIntPtr StructBytes;
            public ulong Index;
            public ulong Expected;
            public ulong Actual;
            public int Status;
            public int Reason;
            public fixed byte Text[TextBytes];
        }

        [StructLayout(LayoutKind.Sequential)]
        internal struct BasisInfo
        {
            public UIntPtr StructBytes;
            public uint VertexCount;
            public uint FaceCount;
            public uint ControlCount;
            public uint LevelCount;
            public fixed byte ContentId[16];
            public fixed byte CompactId[16];
            public uint RenderVertexCount;
            public uint HasTexture;
            public uint BoneCount;
            public uint BoneInfluences;
            public float BoneErrorRms;
            public float BoneErrorMax;
            public float BoneErrorNormals;
            public uint HasExactTier;
        }

        [StructLayout(LayoutKind.Sequential)]
        internal struct WorkspaceOptions
        {
            public UIntPtr StructBytes;
            public int Tier;
            public int Kernels;
        }

        [StructLayout(LayoutKind.Sequential)]
        internal struct FrameOptions
        {
            public UIntPtr StructBytes;
            public float* Positions;
            public UIntPtr PositionFloats;
            public float* Normals;
            public UIntPtr NormalFloats;
        }

        [StructLayout(LayoutKind.Sequential)]
        internal struct FrameReport
        {
            public UIntPtr StructBytes;
            public int Outcome;
            public Bounds Bounds;
        }

        [StructLayout(LayoutKind.Sequential)]
        internal struct VertexOptions
        {
            public UIntPtr StructBytes;
            public float* Positions;
            public UIntPtr PositionFloats;
            public float* Normals;
            public UIntPtr NormalFloats;
            public void* Bytes;
            public UIntPtr ByteCount;
            public float* Scratch;
            public UIntPtr ScratchFloats;
            public UIntPtr PositionOffset;
            public UIntPtr PositionStride;
            public UIntPtr NormalOffset;
            public UIntPtr NormalStride;
            public UIntPtr TangentOffset;
            public UIntPtr TangentStride;
            public UIntPtr TextureOffset;
            public UIntPtr TextureStride;
            public int Encoding;
        }

        [StructLayout(LayoutKind.Sequential)]
        internal struct DragReport
        {
            public UIntPtr StructBytes;
            public float Misfit;
            public uint StepCount;
        }

        [DllImport(Library)] internal static extern IntPtr sinew_version();
        [DllImport(Library)] internal static extern uint sinew_abi_version();
        [DllImport(Library)] internal static extern IntPtr sinew_status_text(int status);

        [DllImport(Library)] internal static extern int sinew_basis_layout(Layout* layout);
        [DllImport(Library)] internal static extern int sinew_basis_open(uint abiVersion, void* bytes, UIntPtr length, void* memory, UIntPtr memoryBytes, IntPtr* basis, Details* details);
        [DllImport(Library)] internal static extern int sinew_basis_info(IntPtr basis, BasisInfo* info);
        [DllImport(Library)] internal static extern int sinew_basis_render_faces(IntPtr basis, int winding, uint* indices, UIntPtr indexCount);
        [DllImport(Library)] internal static extern int sinew_control_name(IntPtr basis, uint control, byte* name, UIntPtr nameBytes);
        [DllImport(Library)] internal static extern int sinew_control_range(IntPtr basis, uint control, float* minimum, float* maximum);
        [DllImport(Library)] internal static extern int sinew_control_parent(IntPtr basis, uint control, uint* parent, uint* level);

        [DllImport(Library)] internal static extern int sinew_controls_layout(IntPtr basis, Layout* layout);
        [DllImport(Library)] internal static extern int sinew_controls_create(IntPtr basis, void* memory, UIntPtr memoryBytes, IntPtr* controls, Details* details);
        [DllImport(Library)] internal static extern int sinew_control_set(IntPtr controls, uint control, float weight, float* taken);
        [DllImport(Library)] internal static extern int sinew_control_set_unclamped(IntPtr controls, uint control, float weight);
        [DllImport(Library)] internal static extern int sinew_control_get(IntPtr controls, uint control, float* weight);
        [DllImport(Library)] internal static extern int sinew_controls_set_all(IntPtr controls, float* weights, UIntPtr weightCount, Details* details);
        [DllImport(Library)] internal static extern int sinew_controls_get_all(IntPtr controls, float* weights, UIntPtr weightCount);
        [DllImport(Library)] internal static extern int sinew_controls_reset(IntPtr controls);
        [DllImport(Library)] internal static extern int sinew_controls_carry(IntPtr fromBasis, IntPtr from, IntPtr toBasis, IntPtr to, uint* carried);

        [DllImport(Library)] internal static extern int sinew_workspace_layout(IntPtr basis, WorkspaceOptions* options, Layout* layout);
        [DllImport(Library)] internal static extern int sinew_workspace_create(IntPtr basis, WorkspaceOptions* options, void* memory, UIntPtr memoryBytes, IntPtr* workspace, Details* details);
        [DllImport(Library)] internal static extern int sinew_frame(IntPtr basis, IntPtr workspace, IntPtr controls, FrameOptions* options, FrameReport* report, Details* details);
        [DllImport(Library)] internal static extern int sinew_vertices_write(IntPtr basis, VertexOptions* options, Bounds* bounds, Details* details);

        [DllImport(Library)] internal static extern int sinew_pins_layout(IntPtr basis, uint capacity, Layout* layout);
        [DllImport(Library)] internal static extern int sinew_pins_create(IntPtr basis, uint capacity, void* memory, UIntPtr memoryBytes, IntPtr* pins, Details* details);
        [DllImport(Library)] internal static extern int sinew_pins_add(IntPtr basis, IntPtr pins, IntPtr workspace, uint vertex, Details* details);
        [DllImport(Library)] internal static extern int sinew_pins_remove(IntPtr pins, uint vertex);
        [DllImport(Library)] internal static extern int sinew_pins_move(IntPtr pins, uint vertex, float* target);
        [DllImport(Library)] internal static extern int sinew_pins_lock(IntPtr pins, uint control, int isLocked);
        [DllImport(Library)] internal static extern int sinew_pins_drag(IntPtr basis, IntPtr pins, IntPtr workspace, IntPtr controls, DragReport* report, Details* details);

        internal static UIntPtr Size(long bytes)
        {
            return new UIntPtr((ulong)bytes);
        }

        /// Details that a call can write into.
        internal static Details NewDetails()
        {
            return new Details { StructBytes = Size(sizeof(Details)) };
        }

        /// Throws what a call without details says.
        internal static void Check(int status)
        {
            if (status != 0)
            {
                throw new SinewException((SinewStatus)status, Marshal.PtrToStringAnsi(sinew_status_text(status)));
            }
        }

        /// Throws what a call with details says.
        internal static void Check(int status, Details* details)
        {
            if (status != 0)
            {
                throw new SinewException((SinewStatus)status, Text(details->Text, TextBytes));
            }
        }

        /// UTF-8 up to the NUL.
        internal static string Text(byte* text, int bytesMax)
        {
            var length = 0;
            while (length < bytesMax && text[length] != 0)
            {
                length++;
            }
            return System.Text.Encoding.UTF8.GetString(text, length);
        }
    }
}
