//! What master and workers say to each other: MessagePack in length-limited envelopes.
