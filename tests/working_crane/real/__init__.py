"""Recordings of cranes with what an ideal rope leaves out: mass, reeving, elastic pivots, turbulent wind, the ground.

Bodies are moved by MuJoCo. The reading is the second difference of the housing's place; nothing here imports the gateway.
"""
