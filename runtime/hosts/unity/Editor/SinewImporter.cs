using System.IO;
using UnityEditor.AssetImporters;
using UnityEngine;

namespace Sinew.Editor
{
    /// `.sinew` files in the project become `SinewPackage` assets. One that does not open is named in the console.
    [ScriptedImporter(1, "sinew")]
    public sealed class SinewImporter : ScriptedImporter
    {
        public override void OnImportAsset(AssetImportContext context)
        {
            var asset = ScriptableObject.CreateInstance<SinewPackage>();
            asset.bytes = File.ReadAllBytes(context.assetPath);
            try
            {
                new Package(asset.bytes).Dispose();
            }
            catch (SinewException fault)
            {
                context.LogImportError(context.assetPath + ": " + fault.Message);
            }
            context.AddObjectToAsset("package", asset);
            context.SetMainObject(asset);
        }
    }
}
