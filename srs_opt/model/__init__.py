"""The snake's models as CasADi expressions: one kinematics, one friction law, one actuator."""
