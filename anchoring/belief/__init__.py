"""The environment model: existing objects, with degrees of belief (Baum et al.: "Data association in a world model").

Each instance has a probability of existence and a belief about each of its attributes; observations update all of them.
Beliefs of all instances are arrays; association, prediction and update are functions of arrays.
"""
