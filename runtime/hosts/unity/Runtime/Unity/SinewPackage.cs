using UnityEngine;

namespace Sinew
{
    /// A baked package in the project: what a `.sinew` file is imported as.
    public sealed class SinewPackage : ScriptableObject
    {
        [HideInInspector] public byte[] bytes = new byte[0];
    }
}
