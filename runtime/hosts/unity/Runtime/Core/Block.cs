using System;
using System.Runtime.InteropServices;

namespace Sinew
{
    /// Memory outside the managed heap that a handle of the library lies in. It stands until it is disposed of *and* the last
    /// call in flight and the last block that refers to it are gone, whatever thread they are on.
    internal sealed unsafe class Block : SafeHandle
    {
        readonly Block parent;
        // A SafeHandle lets more in while others hold it.
        volatile bool disposed;

        internal byte* Pointer { get; }
        internal long Bytes { get; }

        /// `parent`: what the content refers to, or null.
        internal Block(long bytes, long alignment, Block parent) : base(IntPtr.Zero, true)
        {
            SetHandle(Marshal.AllocHGlobal(new IntPtr(bytes + alignment)));
            if (parent != null)
            {
                var held = false;
                parent.DangerousAddRef(ref held);
                this.parent = parent;
            }
            Pointer = (byte*)((handle.ToInt64() + alignment - 1) / alignment * alignment);
            Bytes = bytes;
        }

        internal static Block ForHandle(Native.Layout layout, Block parent)
        {
            return new Block((long)layout.SizeBytes, (long)layout.Alignment, parent);
        }

        /// Before a call that uses the memory: it stands until `Leave`, even if another thread disposes of it. Returns true.
        /// Throws `ObjectDisposedException` where it was disposed of.
        internal bool Enter()
        {
            if (disposed)
            {
                throw new ObjectDisposedException("Sinew");
            }
            var held = false;
            DangerousAddRef(ref held);
            return held;
        }

        /// `held`: what `Enter` returned; false where it was not reached.
        internal void Leave(bool held)
        {
            if (held)
            {
                DangerousRelease();
            }
        }

        public override bool IsInvalid => handle == IntPtr.Zero;

        protected override void Dispose(bool disposing)
        {
            disposed = true;
            base.Dispose(disposing);
        }

        protected override bool ReleaseHandle()
        {
            Marshal.FreeHGlobal(handle);
            parent?.DangerousRelease();
            return true;
        }
    }
}
