"""What people and CI servers look at: findings as text, `top`, plots, and the server of `view`.

In come findings, rules and a vehicle's samples. It imports base, definitions, sources, check, link, messages,
vehicle, recordings and doctor.
"""
