"""What people and CI servers look at: findings as texts and documents, the table of `top`, and the server of `view`.

In come findings, rules and a vehicle's samples. It imports base, sources, check, doctor, live and recordings.
"""
