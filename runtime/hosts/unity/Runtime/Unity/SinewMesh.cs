using System.Collections.Generic;
using Unity.Collections;
using Unity.Collections.LowLevel.Unsafe;
using UnityEngine;
using UnityEngine.Rendering;

namespace Sinew
{
    /// Plays a package on this object's mesh: weights in the inspector, an animation or a script move it, once a frame. The
    /// source's axes are right-handed and Unity's left-handed: put the object under a parent with scale (-1, 1, 1) where left
    /// and right matter.
    [ExecuteAlways]
    [RequireComponent(typeof(MeshFilter))]
    public sealed unsafe class SinewMesh : MonoBehaviour
    {
        const MeshUpdateFlags Quick = MeshUpdateFlags.DontRecalculateBounds | MeshUpdateFlags.DontValidateIndices
            | MeshUpdateFlags.DontNotifyMeshUsers;
        const int VertexBytes = 24;

        public SinewPackage package;
        public Tier tier = Tier.Exact;
        /// One a control, in the package's order.
        public float[] weights = new float[0];

        SinewPackage openedFrom;
        Tier openedTier;
        Package opened;
        Player player;
        Mesh mesh;
        NativeArray<float> positions, normals;
        NativeArray<byte> vertices;

        /// Names, ranges and tree; null while no package is open.
        public IReadOnlyList<Control> Controls => opened?.Controls;

        /// A weight by name.
        public float this[string control]
        {
            get => weights[opened.IndexOf(control)];
            set => weights[opened.IndexOf(control)] = value;
        }

        void OnEnable() => Open();

        void OnDisable() => Close();

        void LateUpdate()
        {
            if (openedFrom != package || openedTier != tier)
            {
                Close();
                Open();
            }
            if (player != null)
            {
                Play();
            }
        }

        void Open()
        {
            openedFrom = package;
            openedTier = tier;
            if (package == null)
            {
                return;
            }
            try
            {
                opened = new Package(package.bytes);
                player = new Player(opened, tier);
            }
            catch (SinewException fault)
            {
                Debug.LogError("Sinew: " + package.name + ": " + fault.Message, this);
                Close();
                return;
            }
            System.Array.Resize(ref weights, opened.Controls.Count);
            positions = new NativeArray<float>(3 * opened.VertexCount, Allocator.Persistent);
            normals = new NativeArray<float>(3 * opened.VertexCount, Allocator.Persistent);
            vertices = new NativeArray<byte>(VertexBytes * opened.RenderVertexCount, Allocator.Persistent);
            mesh = new Mesh { name = package.name, hideFlags = HideFlags.DontSave };
            mesh.MarkDynamic();
            mesh.SetVertexBufferParams(opened.RenderVertexCount,
                new VertexAttributeDescriptor(VertexAttribute.Position, VertexAttributeFormat.Float32, 3, 0),
                new VertexAttributeDescriptor(VertexAttribute.Normal, VertexAttributeFormat.Float32, 3, 0),
                new VertexAttributeDescriptor(VertexAttribute.TexCoord0, VertexAttributeFormat.Float32, 2, 1));
            Play();
            WriteTexture();
            mesh.indexFormat = IndexFormat.UInt32;
            // Seen in left-handed axes, the source's triangles go round as Unity wants them.
            mesh.SetIndices(opened.Faces(), MeshTopology.Triangles, 0, false);
            GetComponent<MeshFilter>().sharedMesh = mesh;
        }

        void Play()
        {
            var x = (float*)positions.GetUnsafePtr();
            var n = (float*)normals.GetUnsafePtr();
            try
            {
                player.SetAll(weights);
                var box = player.Frame(x, positions.Length, n, normals.Length);
                var layout = new VertexLayout { PositionStride = VertexBytes, NormalOffset = 12, NormalStride = VertexBytes };
                player.WriteVertices(layout, x, n, null, vertices.GetUnsafePtr(), vertices.Length);
                var minimum = new Vector3(box.MinimumX, box.MinimumY, box.MinimumZ);
                var maximum = new Vector3(box.MaximumX, box.MaximumY, box.MaximumZ);
                mesh.bounds = new UnityEngine.Bounds((minimum + maximum) / 2, maximum - minimum);
            }
            catch (SinewException fault)
            {
                Debug.LogError("Sinew: " + package.name + ": " + fault.Message, this);
                return;
            }
            mesh.SetVertexBufferData(vertices, 0, 0, vertices.Length, 0, Quick);
        }

        /// Texture coordinates do not move: once is enough.
        void WriteTexture()
        {
            using (var texture = new NativeArray<byte>(8 * opened.RenderVertexCount, Allocator.Temp))
            {
                if (opened.HasTexture)
                {
                    var layout = new VertexLayout { TextureStride = 8 };
                    player.WriteVertices(layout, (float*)positions.GetUnsafePtr(), null, null, texture.GetUnsafePtr(), texture.Length);
                }
                mesh.SetVertexBufferData(texture, 0, 0, texture.Length, 1, Quick);
            }
        }

        void Close()
        {
            player?.Dispose();
            opened?.Dispose();
            player = null;
            opened = null;
            if (positions.IsCreated)
            {
                positions.Dispose();
                normals.Dispose();
                vertices.Dispose();
            }
            if (mesh != null)
            {
                DestroyImmediate(mesh);
            }
        }
    }
}
