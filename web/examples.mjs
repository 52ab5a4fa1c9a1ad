// Examples of the playground, by name; the first one is shown first.
export const EXAMPLES = {
  "Mass on a belt": `# The tutorial: friction holds the mass on a belt of speed 1
# until the spring is as strong, at t = 0.4.
states q = 0, v = 1
controls F = 0
parameters k = 1, mu = 0.5

q' = v
v' = F - k*q - 0.1*v + mu*sign(1 - v)

simulate 10
`,
  "Stick and slip": `# Friction that falls with the speed of sliding: sticks at 7.18, slips at 8.43.
states q = 0, v = 0
controls F = 0

slip = 1 - v
q' = v
v' = F - q + sign(slip)/(1 + abs(slip))

simulate 20
`,
  "Best force on the belt": `# From rest at 0 to rest at 2 with little force; the mass overtakes the belt.
states q = 0, v = 0
controls F

slip = 1 - v
q' = v
v' = F - q + sign(slip)/(1 + abs(slip))

-3 <= F <= 3
minimise F^2
at end q = 2, v = 0
solve 2 in 10 stages
`,
  "Car with turbo": `# The turbo has three times the force: on from a speed of 15 until it falls below 10.
# The least time for 150 m; the known optimum is 10.22925791133.
states q = 0, v = 0
controls u

turbo = hysteresis(v, 15, 10)
q' = v
v' = (1 + 2*turbo)*u

-5 <= u <= 5
-25 <= v <= 25
minimise at end t
at end q = 150, v = 0
solve 10 in 10 stages, time from 1 to 60
option n_fe = 1
`,
  "Bouncing ball": `# Falls, and keeps 0.8 of its speed in every impact.
states h = 1, v = 0
parameters g = 9.81, e = 0.8

h' = v
v' = -g
when h < 0: h = 0, v = -e*v

simulate 2.5
`,
  "Thermostat": `# Heats below 19 degrees until 21; it is colder outside at night.
states T = 17
outside = 8 - 6*cos(2*pi*t/24)
heating = hysteresis(-T, -19, -21)
T' = (outside - T)/8 + 2*heating

simulate 48
`,
  "Relay in a loop": `# Three lags and a relay: a limit cycle.
states x = 0, y = 0, z = 0.2
x' = relay(z, -1, 1) - x
y' = x - y
z' = y - z

simulate 20
`,
};
