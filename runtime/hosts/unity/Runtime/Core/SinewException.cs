using System;

namespace Sinew
{
    /// What the library says of a call. More may come with newer libraries; sinew.h lists them all.
    public enum SinewStatus
    {
        Ok = 0,
        TooShort = 3,
        WrongAbi = 8,
        PackageRefused = 9,
        InUse = 15,
        NoSuchControl = 20,
        NotFinite = 22,
        FrameOverflow = 23,
        NoBones = 24,
        NeedsExactTier = 25,
        NeedsBones = 26,
        NoSuchVertex = 30,
        AlreadyPinned = 31,
        NotPinned = 32,
        PinsFull = 33,
        NoTexture = 41,
    }

    /// A call that the library refused. Unless the sentence says otherwise, nothing has changed.
    public sealed class SinewException : Exception
    {
        public SinewStatus Status { get; }

        internal SinewException(SinewStatus status, string text) : base(text)
        {
            Status = status;
        }
    }
}
