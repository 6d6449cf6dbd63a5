// Checks the scripts that do not touch Unity against the library: Checks.exe PACKAGE FRAME SIZES. PACKAGE is baked, FRAME has
// the positions that it plays at the weights below, SIZES what sizes.c prints. Prints a line a check; ends with 1 where one fails.

using System;
using System.Collections.Generic;
using System.Diagnostics;
using System.Globalization;
using System.IO;
using System.Linq;
using System.Reflection;
using System.Runtime.InteropServices;
using System.Threading;
using Sinew;

static unsafe class Checks
{
    static readonly float[] Weights = { 1.0f, -0.75f, 0.5f, 2.0f };
    static int failed;

    static void Check(string what, Action check)
    {
        try
        {
            check();
            Console.WriteLine("ok      " + what);
        }
        catch (Exception fault)
        {
            failed++;
            Console.WriteLine("FAILED  " + what + ": " + fault.Message);
        }
    }

    static void Expect(bool holds, string what)
    {
        if (!holds)
        {
            throw new Exception(what);
        }
    }

    static void Throws<T>(Action act, Func<T, bool> fits = null) where T : Exception
    {
        try
        {
            act();
        }
        catch (T fault)
        {
            Expect(fits == null || fits(fault), "another " + typeof(T).Name + ": " + fault.Message);
            return;
        }
        throw new Exception("no " + typeof(T).Name);
    }

    static bool Is(SinewException fault, SinewStatus status)
    {
        return fault.Status == status && fault.Message.Length > 10;
    }

    static int Main(string[] arguments)
    {
        var bytes = File.ReadAllBytes(arguments[0]);
        var frame = File.ReadAllText(arguments[1]).Split(new[] { ' ', '\n' }, StringSplitOptions.RemoveEmptyEntries)
            .Select(number => float.Parse(number, CultureInfo.InvariantCulture)).ToArray();
        Check("structs are as long as in the headers", () => Sizes(File.ReadAllLines(arguments[2])));
        Check("a frame is the runtime's", () => Golden(bytes, frame));
        Check("render vertices are those of the frame", () => RenderVertices(bytes));
        Check("a package that is none is refused with a sentence", () => Refused(bytes));
        Check("wrong arguments are exceptions of their kind", () => Misuse(bytes));
        Check("dragging brings a vertex where it is wanted", () => Dragging(bytes));
        Check("weights are carried by name", () => Carrying(bytes));
        Check("memory stands until its last user is gone", () => Lifetime(bytes));
        Check("two threads on one player: one is refused", () => TwoThreads(bytes));
        Check("disposing in the middle of frames ends them with an exception", () => DisposedWhilePlaying(bytes));
        Check("10,000 frames make no garbage", () => NoGarbage(bytes));
        Check("2,000 packages leave no memory behind", () => NoLeak(bytes));
        return failed == 0 ? 0 : 1;
    }

    static void Sizes(string[] lines)
    {
        var native = typeof(Package).Assembly.GetType("Sinew.Native");
        foreach (var line in lines)
        {
            var words = line.Split(' ');
            var type = native.GetNestedType(words[0], BindingFlags.NonPublic);
            Expect(Marshal.SizeOf(type) == int.Parse(words[1]), words[0] + " has " + Marshal.SizeOf(type) + " bytes, not " + words[1]);
        }
        Expect(lines.Length == 8, lines.Length + " structs");
    }

    static void Golden(byte[] bytes, float[] expected)
    {
        using (var package = new Package(bytes))
        using (var player = new Player(package))
        {
            Expect(package.Controls.Count == 4 && package.Controls[2].Name == "c00.f0" && package.Controls[2].Parent == 0, "tree");
            Expect(package.Controls[0].Minimum == -1.5f && package.Controls[0].Maximum == 2f, "range");
            player.SetAll(Weights);
            var positions = new float[expected.Length];
            var normals = new float[expected.Length];
            var bounds = player.Frame(positions, normals);
            for (var at = 0; at < expected.Length; at++)
            {
                Expect(Math.Abs(positions[at] - expected[at]) <= 1e-5f, "number " + at + " is " + positions[at] + ", not " + expected[at]);
            }
            Expect(bounds.MinimumX == positions.Where((_, at) => at % 3 == 0).Min(), "bounds");
            Expect(Math.Abs(normals[0] * normals[0] + normals[1] * normals[1] + normals[2] * normals[2] - 1) < 1e-5, "normals");
            var again = new float[expected.Length + 2];
            again[again.Length - 1] = 7f;
            fixed (float* first = again)
            {
                player.Frame(first, again.Length, null, 0);
            }
            Expect(again.Take(expected.Length).SequenceEqual(positions) && again[again.Length - 1] == 7f, "the pointer's frame differs");
            player[0] = 99f;
            Expect(player[0] == 2f && player["c00"] == 2f, "not clamped");
            player.SetUnclamped(0, 3f);
            Expect(player[0] == 3f, "clamped");
            player.Reset();
            Expect(player[0] == 0f, "not reset");
        }
    }

    static void RenderVertices(byte[] bytes)
    {
        using (var package = new Package(bytes))
        using (var player = new Player(package))
        {
            player.SetAll(Weights);
            var positions = new float[3 * package.VertexCount];
            var normals = new float[3 * package.VertexCount];
            player.Frame(positions, normals);
            var vertices = new float[8 * package.RenderVertexCount];
            fixed (float* x = positions, n = normals, v = vertices)
            {
                var layout = new VertexLayout
                {
                    PositionStride = 32,
                    NormalOffset = 12,
                    NormalStride = 32,
                    TextureOffset = 24,
                    TextureStride = package.HasTexture ? 32 : 0,
                };
                player.WriteVertices(layout, x, n, null, v, 4 * vertices.Length);
            }
            var points = new HashSet<string>();
            for (var at = 0; at < package.VertexCount; at++)
            {
                points.Add(positions[3 * at] + " " + positions[3 * at + 1] + " " + positions[3 * at + 2]);
            }
            var faces = package.Faces();
            Expect(faces.Length == 3 * package.FaceCount, "faces");
            foreach (var vertex in faces)
            {
                var at = 8 * vertex;
                Expect(points.Contains(vertices[at] + " " + vertices[at + 1] + " " + vertices[at + 2]), "vertex " + vertex);
            }
            var turned = package.Faces(true);
            Expect(turned[0] == faces[0] && turned[1] == faces[2] && turned[2] == faces[1], "winding");
        }
    }

    static void Refused(byte[] bytes)
    {
        Throws<SinewException>(() => new Package(new byte[3]), fault => Is(fault, SinewStatus.PackageRefused));
        Throws<SinewException>(() => new Package(new byte[1000]), fault => Is(fault, SinewStatus.PackageRefused));
        var random = new Random(1);
        for (var n = 0; n < 200; n++)
        {
            var damaged = (byte[])bytes.Clone();
            damaged[random.Next(damaged.Length)] ^= (byte)(1 << random.Next(8));
            Throws<SinewException>(() => new Package(damaged), fault => Is(fault, SinewStatus.PackageRefused));
        }
        Throws<ArgumentNullException>(() => new Package(null));
        Throws<ArgumentNullException>(() => new Player(null));
    }

    static void Misuse(byte[] bytes)
    {
        using (var package = new Package(bytes))
        using (var player = new Player(package))
        {
            Throws<ArgumentOutOfRangeException>(() => player[4] = 0);
            Throws<ArgumentOutOfRangeException>(() => player[-1] = 0);
            Throws<ArgumentException>(() => player["nobody"] = 0);
            Throws<SinewException>(() => player[0] = float.NaN, fault => Is(fault, SinewStatus.NotFinite));
            Throws<SinewException>(() => player.SetAll(new[] { 1f, 1f, float.PositiveInfinity, 1f }), fault => Is(fault, SinewStatus.NotFinite));
            Expect(player[0] == 0, "a refused call has set a weight");
            Throws<ArgumentException>(() => player.SetAll(new float[3]));
            Throws<ArgumentNullException>(() => player.SetAll(null));
            Throws<ArgumentNullException>(() => player.Frame(null));
            Throws<SinewException>(() => player.Frame(new float[5]), fault => Is(fault, SinewStatus.TooShort));
            Throws<SinewException>(() => player.SetUnclamped(0, float.NegativeInfinity), fault => Is(fault, SinewStatus.NotFinite));
        }
    }

    static void Dragging(byte[] bytes)
    {
        using (var package = new Package(bytes))
        using (var player = new Player(package))
        using (var pins = new Pins(player, 2))
        {
            var positions = new float[3 * package.VertexCount];
            player.SetAll(new[] { 0.5f, 0.25f, 0f, 0f });
            player.Frame(positions);
            var (x, y, z) = (positions[24], positions[25], positions[26]);
            player.Reset();
            player.Frame(positions);
            pins.Add(8);
            Throws<SinewException>(() => pins.Add(8), fault => Is(fault, SinewStatus.AlreadyPinned));
            Throws<SinewException>(() => pins.Add(9), fault => Is(fault, SinewStatus.NoSuchVertex));
            Throws<OverflowException>(() => pins.Add(-1));
            pins.Move(8, x, y, z);
            var before = Math.Abs(positions[24] - x) + Math.Abs(positions[25] - y) + Math.Abs(positions[26] - z);
            var misfit = float.MaxValue;
            for (var n = 0; n < 20; n++)
            {
                misfit = pins.Drag();
            }
            Expect(misfit < 0.1 * before, misfit + " of " + before + " left");
            pins.Remove(8);
            Throws<SinewException>(() => pins.Move(8, x, y, z), fault => Is(fault, SinewStatus.NotPinned));
        }
        Throws<ArgumentOutOfRangeException>(() => new Pins(new Player(new Package(bytes)), 65));
    }

    static void Carrying(byte[] bytes)
    {
        using (var old = new Package(bytes))
        using (var renewed = new Package(bytes))
        using (var from = new Player(old))
        using (var to = new Player(renewed))
        {
            from["c01"] = -1f;
            Expect(to.CarryFrom(from) == 4 && to["c01"] == -1f, "not carried");
            Throws<ArgumentNullException>(() => to.CarryFrom(null));
        }
    }

    static void Lifetime(byte[] bytes)
    {
        var package = new Package(bytes);
        var player = new Player(package);
        package.Dispose();
        player.Frame(new float[3 * package.VertexCount]);
        Throws<ObjectDisposedException>(() => new Player(package));
        player.Dispose();
        player.Dispose();
        Throws<ObjectDisposedException>(() => player.Frame(new float[3 * package.VertexCount]));
        Throws<ObjectDisposedException>(() => player[0] = 1);
        Throws<ObjectDisposedException>(() => package.Faces());
        for (var n = 0; n < 100; n++)
        {
            new Pins(new Player(new Package(bytes)));
        }
        GC.Collect();
        GC.WaitForPendingFinalizers();
    }

    static void TwoThreads(byte[] bytes)
    {
        using (var package = new Package(bytes))
        using (var player = new Player(package))
        {
            var other = 0;
            ThreadStart play = () =>
            {
                var positions = new float[3 * package.VertexCount];
                for (var n = 0; n < 20000; n++)
                {
                    try
                    {
                        player.Frame(positions);
                    }
                    catch (SinewException fault)
                    {
                        if (fault.Status != SinewStatus.InUse)
                        {
                            Interlocked.Increment(ref other);
                        }
                    }
                }
            };
            var threads = new[] { new Thread(play), new Thread(play) };
            foreach (var thread in threads) thread.Start();
            foreach (var thread in threads) thread.Join();
            Expect(other == 0, other + " other faults");
        }
    }

    static void DisposedWhilePlaying(byte[] bytes)
    {
        for (var round = 0; round < 50; round++)
        {
            var package = new Package(bytes);
            var player = new Player(package);
            Exception ended = null;
            var started = new ManualResetEvent(false);
            var thread = new Thread(() =>
            {
                var positions = new float[3 * package.VertexCount];
                try
                {
                    for (;;)
                    {
                        player.Frame(positions);
                        started.Set();
                    }
                }
                catch (Exception fault)
                {
                    ended = fault;
                }
            });
            thread.Start();
            started.WaitOne();
            package.Dispose();
            player.Dispose();
            thread.Join();
            Expect(ended is ObjectDisposedException, "ended by " + ended);
        }
    }

    static void NoGarbage(byte[] bytes)
    {
        using (var package = new Package(bytes))
        using (var player = new Player(package))
        {
            var positions = new float[3 * package.VertexCount];
            var normals = new float[3 * package.VertexCount];
            Play(player, positions, normals, 100);
            var watch = new Stopwatch();
            GC.Collect();
            var (collections, memory) = (GC.CollectionCount(0), GC.GetTotalMemory(false));
            watch.Start();
            Play(player, positions, normals, 10000);
            watch.Stop();
            var grown = GC.GetTotalMemory(false) - memory;
            Expect(GC.CollectionCount(0) == collections && grown == 0, grown + " bytes in 10,000 frames");
            Console.WriteLine("        {0:0.0} us a frame of {1} vertices", watch.Elapsed.TotalMilliseconds / 10, package.VertexCount);
        }
    }

    static void Play(Player player, float[] positions, float[] normals, int count)
    {
        for (var n = 0; n < count; n++)
        {
            player[0] = (n % 100) * 0.01f;
            player.Frame(positions, normals);
        }
    }

    static void NoLeak(byte[] bytes)
    {
        OpenAndClose(bytes, 200);
        var before = Resident();
        OpenAndClose(bytes, 2000);
        var grown = Resident() - before;
        Expect(grown < 4 << 20, grown + " bytes more");
    }

    static void OpenAndClose(byte[] bytes, int count)
    {
        for (var n = 0; n < count; n++)
        {
            using (var package = new Package(bytes))
            using (var player = new Player(package))
            using (new Pins(player))
            {
                player.Frame(new float[3 * package.VertexCount]);
            }
        }
    }

    static long Resident()
    {
        GC.Collect();
        GC.WaitForPendingFinalizers();
        using (var process = Process.GetCurrentProcess())
        {
            return process.WorkingSet64;
        }
    }
}
