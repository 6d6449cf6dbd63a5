using UnityEngine;

namespace Sinew.Samples
{
    /// Swings one control between its stops.
    public sealed class Swing : MonoBehaviour
    {
        public SinewMesh mesh;
        public int control;

        void Update()
        {
            var range = mesh.Controls[control];
            var along = 0.5f + 0.5f * Mathf.Sin(Time.time);
            mesh.weights[control] = Mathf.Lerp(range.Minimum, range.Maximum, along);
        }
    }
}
