"""The site gateway: a daemon that positions a sticking valve, and the small tools around it.

`estimation` identifies the valve from integrals of its signals, `control` is the pure core (supervision, states
S0 to S3, the law), `daemon` gives it a bus, a clock and registers, `cli` is the roof: one file a command.
"""
