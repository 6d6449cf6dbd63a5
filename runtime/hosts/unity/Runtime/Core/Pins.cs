using System;

namespace Sinew
{
    /// Vertices of a player that the user holds, and the weights that bring them to where they are wanted. The player must be of
    /// the exact tier; one thread at a time.
    public sealed unsafe class Pins : IDisposable
    {
        readonly Block block;
        readonly IntPtr pins;

        public Player Player { get; }

        /// `capacity`: vertices held at once, at most 64.
        public Pins(Player player, int capacity = 8)
        {
            if (player == null)
            {
                throw new ArgumentNullException(nameof(player));
            }
            if (capacity < 1 || capacity > 64)
            {
                throw new ArgumentOutOfRangeException(nameof(capacity), capacity, "1 to 64 vertices can be held at once");
            }
            Player = player;
            var held = player.Enter();
            try
            {
                Native.Layout layout;
                Native.Check(Native.sinew_pins_layout(player.Package.Basis, (uint)capacity, &layout));
                block = Block.ForHandle(layout, player.Block);
                IntPtr made;
                var details = Native.NewDetails();
                Native.Check(Native.sinew_pins_create(player.Package.Basis, (uint)capacity, block.Pointer, Native.Size(block.Bytes), &made, &details), &details);
                pins = made;
            }
            catch
            {
                Dispose();
                throw;
            }
            finally
            {
                player.Leave(held);
            }
        }

        /// Takes hold of a vertex (source order) where the player's last frame has it. Costs one solve.
        public void Add(int vertex)
        {
            var held = Enter();
            try
            {
                var details = Native.NewDetails();
                Native.Check(Native.sinew_pins_add(Player.Package.Basis, pins, Player.Workspace, checked((uint)vertex), &details), &details);
            }
            finally
            {
                Leave(held);
            }
        }

        /// Lets go of a vertex.
        public void Remove(int vertex)
        {
            var held = Enter();
            try
            {
                Native.Check(Native.sinew_pins_remove(pins, checked((uint)vertex)));
            }
            finally
            {
                Leave(held);
            }
        }

        /// Says where a held vertex should go, in the source's units and axes.
        public void Move(int vertex, float x, float y, float z)
        {
            var held = Enter();
            try
            {
                var target = stackalloc float[3];
                target[0] = x;
                target[1] = y;
                target[2] = z;
                Native.Check(Native.sinew_pins_move(pins, checked((uint)vertex), target));
            }
            finally
            {
                Leave(held);
            }
        }

        /// Leaves a control alone while dragging, or no longer.
        public void Lock(int control, bool locked)
        {
            var held = Enter();
            try
            {
                Native.Check(Native.sinew_pins_lock(pins, checked((uint)control), locked ? 1 : 0));
            }
            finally
            {
                Leave(held);
            }
        }

        /// Moves the player's weights so that held vertices come nearer to their targets: once an update, then play a frame.
        /// Returns the largest distance that is left.
        public float Drag()
        {
            var held = Enter();
            try
            {
                var report = new Native.DragReport { StructBytes = Native.Size(sizeof(Native.DragReport)) };
                var details = Native.NewDetails();
                Native.Check(Native.sinew_pins_drag(Player.Package.Basis, pins, Player.Workspace, Player.Weights, &report, &details), &details);
                return report.Misfit;
            }
            finally
            {
                Leave(held);
            }
        }

        // The block refers to the player's, so holding it holds them both; a player that was disposed of is still refused.
        bool Enter()
        {
            Player.Leave(Player.Enter());
            return block.Enter();
        }

        void Leave(bool held) => block.Leave(held);

        public void Dispose()
        {
            block?.Dispose();
        }
    }
}
