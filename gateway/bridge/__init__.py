"""The bridges to a plant's own protocols: each is a process apart that reads the bus, and takes nothing with it when it ends.

What is known of the gateway is judged once, in `plant_snapshot`; an adapter only says it in its protocol.
"""
