"""Multi-line systems: ropes connected at points and sheaves; their step, statics and energy."""
