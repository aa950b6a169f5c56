"""The control core: a pure function of what it remembers, one sample and what the DCS asks for.

`controller.step` reads top to bottom: supervise, follow the reference, identify, choose the state, command. It
never reads a clock, sleeps, writes a file or touches a socket, so the same code runs in virtual time, lockstep and
real time.
"""
