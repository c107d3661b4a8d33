// publishers: name, uORB topic, instance, options
pub /fmu/out/pack_status pack_status 0 rel=reliable,express=true,cc=block
pub /fmu/out/pack_status_backup pack_status_backup 0 express=false,an_option_of_tomorrow=5
pub /fmu/out/fleet_status fleet_status 0
sub /fmu/in/fleet_status fleet_status -1
