// The parts of Unity's interface that this package uses, without bodies that do anything: so that its scripts compile where
// Unity is not installed. They prove spelling and types, not behaviour.

using System;

namespace Unity.Collections
{
    public enum Allocator { Temp, Persistent }

    public struct NativeArray<T> : IDisposable where T : struct
    {
        public NativeArray(int length, Allocator allocator) { Length = length; }
        public int Length { get; }
        public bool IsCreated => false;
        public void Dispose() { }
    }
}

namespace Unity.Collections.LowLevel.Unsafe
{
    public static unsafe class NativeArrayUnsafeUtility
    {
        public static void* GetUnsafePtr<T>(this NativeArray<T> array) where T : struct => null;
    }
}

namespace UnityEngine.Rendering
{
    [Flags] public enum MeshUpdateFlags { DontValidateIndices = 1, DontNotifyMeshUsers = 4, DontRecalculateBounds = 8 }
    public enum IndexFormat { UInt16, UInt32 }
    public enum VertexAttribute { Position, Normal, TexCoord0 }
    public enum VertexAttributeFormat { Float32 }

    public struct VertexAttributeDescriptor
    {
        public VertexAttributeDescriptor(VertexAttribute attribute, VertexAttributeFormat format, int dimension, int stream) { }
    }
}

namespace UnityEngine
{
    using Rendering;
    using Unity.Collections;

    public enum MeshTopology { Triangles }
    [Flags] public enum HideFlags { DontSave = 52 }
    public sealed class ExecuteAlways : Attribute { }
    public sealed class HideInInspector : Attribute { }
    public sealed class RequireComponent : Attribute { public RequireComponent(Type type) { } }

    public struct Vector3
    {
        public Vector3(float x, float y, float z) { }
        public static Vector3 operator +(Vector3 a, Vector3 b) => a;
        public static Vector3 operator -(Vector3 a, Vector3 b) => a;
        public static Vector3 operator /(Vector3 a, float b) => a;
    }

    public struct Bounds { public Bounds(Vector3 center, Vector3 size) { } }
    public static class Mathf
    {
        public static float Sin(float x) => x;
        public static float Lerp(float a, float b, float t) => t;
    }
    public static class Time { public static float time => 0; }
    public static class Debug { public static void LogError(object message, Object context) { } }

    public class Object
    {
        public string name { get; set; }
        public HideFlags hideFlags { get; set; }
        public static void DestroyImmediate(Object value) { }
    }

    public class ScriptableObject : Object { public static T CreateInstance<T>() where T : ScriptableObject => null; }
    public class Component : Object { public T GetComponent<T>() => default(T); }
    public class MonoBehaviour : Component { }
    public class MeshFilter : Component { public Mesh sharedMesh { get; set; } }

    public class Mesh : Object
    {
        public Bounds bounds { get; set; }
        public IndexFormat indexFormat { get; set; }
        public void MarkDynamic() { }
        public void SetVertexBufferParams(int count, params VertexAttributeDescriptor[] attributes) { }
        public void SetVertexBufferData<T>(Unity.Collections.NativeArray<T> data, int from, int to, int count, int stream, MeshUpdateFlags flags) where T : struct { }
        public void SetIndices(int[] indices, MeshTopology topology, int submesh, bool calculateBounds) { }
    }
}

namespace UnityEditor
{
    public sealed class CustomEditor : Attribute { public CustomEditor(Type type) { } }

    public class SerializedProperty
    {
        public int arraySize => 0;
        public float floatValue { get; set; }
        public SerializedProperty GetArrayElementAtIndex(int index) => null;
    }

    public class SerializedObject
    {
        public void Update() { }
        public bool ApplyModifiedProperties() => false;
        public SerializedProperty FindProperty(string name) => null;
    }

    public class Editor
    {
        public UnityEngine.Object target => null;
        public SerializedObject serializedObject => null;
        public virtual void OnInspectorGUI() { }
    }

    public static class EditorGUI { public static int indentLevel { get; set; } }

    public static class EditorGUILayout
    {
        public static bool PropertyField(SerializedProperty property) => false;
        public static float Slider(string label, float value, float from, float to) => value;
    }
}

namespace UnityEditor.AssetImporters
{
    public sealed class ScriptedImporterAttribute : Attribute { public ScriptedImporterAttribute(int version, string extension) { } }

    public abstract class ScriptedImporter : UnityEngine.Object { public abstract void OnImportAsset(AssetImportContext context); }

    public class AssetImportContext
    {
        public string assetPath => null;
        public void AddObjectToAsset(string name, UnityEngine.Object value) { }
        public void SetMainObject(UnityEngine.Object value) { }
        public void LogImportError(string message) { }
    }
}
