"""What this machine offers: devices, LLVM, memory, versions."""
