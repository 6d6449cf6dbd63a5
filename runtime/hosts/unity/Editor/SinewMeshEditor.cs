using UnityEditor;
using UnityEngine;

namespace Sinew.Editor
{
    /// Sliders with the controls' names and ranges, indented as in the tree.
    [CustomEditor(typeof(SinewMesh))]
    public sealed class SinewMeshEditor : UnityEditor.Editor
    {
        public override void OnInspectorGUI()
        {
            var mesh = (SinewMesh)target;
            serializedObject.Update();
            EditorGUILayout.PropertyField(serializedObject.FindProperty("package"));
            EditorGUILayout.PropertyField(serializedObject.FindProperty("tier"));
            var weights = serializedObject.FindProperty("weights");
            for (var k = 0; mesh.Controls != null && k < mesh.Controls.Count && k < weights.arraySize; k++)
            {
                var control = mesh.Controls[k];
                EditorGUI.indentLevel = control.Level;
                var weight = weights.GetArrayElementAtIndex(k);
                weight.floatValue = EditorGUILayout.Slider(control.Name, weight.floatValue, control.Minimum, control.Maximum);
            }
            EditorGUI.indentLevel = 0;
            serializedObject.ApplyModifiedProperties();
        }
    }
}
