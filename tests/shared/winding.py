"""The winding of a motor under a voltage that somebody sets: the model that searches for what is missing begin with."""

MODEL = """# a motor
name: motor
sample_time: 0.02 s
accuracy: 3 %
time_between_false_alarms: 1 h
inputs: {V: {unit: V}}
components:
  source: {type: Se, law: e = V}
  R: {type: R, parameters: {R: 3 ohm}}      # winding
  L: {type: I, parameters: {L: {nominal: 2.5 H, accuracy: 5 %}}, start: {p: 0 V*s, sd: 0.001 V*s}}
junctions: {armature: 1}
bonds: [source -> armature -> R, armature -> L]
sensors: {i: {reads: armature.f, unit: A, noise: 50 mA}}
"""
